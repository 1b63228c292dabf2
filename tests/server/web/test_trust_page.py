"""Who speaks plain HTTP to the HTTPS port learns how to trust it, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from starlette.testclient import TestClient

from server.security.least_role import roles_of
from server.security.request_guard import Guard
from server.security.security import Doors
from server.security.tls import certificate
from server.web.page_files import CLIENT
from server.web.trust_page import PAGES, trust_app

BASE = "http://robot.lan:8443"
STYLES = {"/style.css", "/trust.css"}


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = certificate(tmp_path_factory.mktemp("tls")).authority
    assert made is not None
    return made


def client(authority: Path | None) -> TestClient:
    app = trust_app(authority)
    guard = Guard(app, Doors(), ["robot.lan"], roles=roles_of(app.routes))
    return TestClient(guard, base_url=BASE, follow_redirects=False)


def test_it_shows_the_fingerprint_the_way_to_the_authority_and_the_secure_page(
    authority: Path,
) -> None:
    asks = client(authority)
    page = asks.get("/").text
    loaded = x509.load_pem_x509_certificate(authority.read_bytes())
    assert loaded.fingerprint(hashes.SHA256()).hex(":").upper() in page
    assert 'href="https://robot.lan:8443/"' in page
    assert "$" not in page
    file = asks.get("/ca.crt")
    assert file.content == authority.read_bytes()
    assert file.headers["content-type"] == "application/x-x509-ca-cert"
    assert all(asks.get(path).status_code == 200 for path in STYLES)


@pytest.mark.parametrize(
    ("accepted", "language"),
    [
        ("", "en"),
        ("fr", "fr"),
        ("de,ja", "en"),
        ("frr", "en"),
        ("fr-CH, fr;q=0.9, en;q=0.8, *;q=0.5", "fr"),
        ("en-US,en;q=0.9,fr;q=0.8", "en"),
        ("de;q=0.9,en;q=0.3,FR;q=0.4", "fr"),
        ("fr, en", "fr"),
        ("fr;q=0", "en"),
        ("fr;q=9999, ;;,=", "en"),
    ],
)
def test_it_speaks_the_language_that_its_reader_likes_best(
    authority: Path, accepted: str, language: str
) -> None:
    answer = client(authority).get("/", headers={"Accept-Language": accepted})
    assert f'<html lang="{language}"' in answer.text
    assert answer.headers["vary"] == "accept-language"
    assert 'href="https://robot.lan:8443/"' in answer.text
    assert "$" not in answer.text


def test_both_languages_say_the_same_parts() -> None:
    bodies = ((CLIENT / name).read_text(encoding="utf-8") for name in PAGES.values())
    english, french = (
        re.findall(r"<(?!/?b>)[^>]+>|\$\w+", one.partition("<body>")[2]) for one in bodies
    )
    assert english == french


def test_nothing_else_is_there_and_nothing_can_be_asked_of_it(authority: Path) -> None:
    app = trust_app(authority)
    assert {route.path for route in app.routes} == {"/", "/ca.crt", *STYLES}  # type: ignore[attr-defined]
    asks = client(authority)
    for path in ("/supervisor", "/api/status", "/api/pair", "/src/app/main.js", "/metrics"):
        assert asks.get(path).status_code in (401, 403, 404)
    own = {"Origin": BASE, "X-Lightleash": "1"}
    for path in ("/", "/api/stop", "/api/pair"):
        assert asks.post(path, headers=own, json={}).status_code in (401, 403, 404, 405)


def test_a_foreign_host_is_not_written_into_the_page(authority: Path) -> None:
    answer = client(authority).get("/", headers={"Host": 'evil"><script>'})
    assert answer.status_code == 421
    assert "script" not in answer.text


def test_with_a_certificate_of_the_owners_plain_http_leads_to_https() -> None:
    answer = client(None).get("/")
    assert answer.status_code == 308
    assert answer.headers["location"] == "https://robot.lan:8443/"
