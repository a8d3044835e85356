from gasp_mpm_host.testing import ExtremesTests


class TestExtremes(ExtremesTests):
    pass
