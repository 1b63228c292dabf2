"""Films that several files of tests read; who changes one copies it first."""

import pytest

from tests.server.tools.locate.locating import write_scene


@pytest.fixture(scope="session")
def films(tmp_path_factory):
    """Folders by scene."""
    return {
        name: write_scene(name, tmp_path_factory.mktemp(name))
        for name in ("typical", "rolling_shutter")
    }
