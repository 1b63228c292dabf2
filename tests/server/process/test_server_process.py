"""The server process: the names it answers to, and what keeps it from starting."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest
from cryptography import x509

from server.common.settings import load
from server.process.server_process import (
    _certificate,
    base_url,
    names_of,
    record_from_the_start,
)
from server.recording import folder
from server.security import tls
from tests.server.house import house_in


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "127.0.0.2", "169.254.7.7", "fd00::7"])
def test_a_server_answers_to_the_address_of_its_links_and_its_certificate_names_it(
    host: str, tmp_path: Path
) -> None:
    settings = load(["--host", host, "--state", str(tmp_path)])
    linked = urlsplit(base_url(settings.host, 8443)).hostname
    assert linked in names_of(settings)
    leaf = tls.load(_certificate(settings).cert)
    names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert linked in {str(name.value) for name in names}


def test_a_full_disk_keeps_no_server_from_starting_that_was_to_record_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = SimpleNamespace(disk_usage=lambda _path: SimpleNamespace(free=0))
    monkeypatch.setattr(folder, "shutil", full)
    with house_in(tmp_path) as house:
        record_from_the_start(house.manager)
        assert house.manager.recordings.name == ""
        assert "only 0 MB are left on the disk" in house.manager.events[0].text
