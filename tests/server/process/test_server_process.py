"""The server process: the names it answers to."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import urlsplit

import pytest
from cryptography import x509

from server.common.settings import load
from server.process.server_process import _certificate, base_url, names_of
from server.security import tls


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
