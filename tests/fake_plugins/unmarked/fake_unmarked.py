"""A plugin whose hook lacks its decorator."""


def gasp_point_engines():
    return []
