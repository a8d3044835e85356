from gasp_mpm_host.testing import AgreementTests


class TestAgreement(AgreementTests):
    pass
