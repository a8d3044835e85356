from gasp_mpm_host.testing import ContactTests


class TestContact(ContactTests):
    pass
