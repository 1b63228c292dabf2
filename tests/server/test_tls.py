"""Certificates: made for this machine, renewed in time, keys for nobody else."""

from __future__ import annotations

import datetime
import socket
import ssl
import threading

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID

from server import tls
from server.tls import LEAF_DAYS, certificate, own_addresses, own_names

MAX_DAYS = 825
"""Longer ones are refused by iOS."""


def load(path):
    return x509.load_pem_x509_certificate(path.read_bytes())


def names_of(leaf):
    extension = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    return {str(name.value) for name in extension.value}


def test_the_certificate_is_what_phones_accept(tmp_path):
    made = certificate(tmp_path)
    leaf, authority = load(made.cert), load(made.authority)
    leaf.verify_directly_issued_by(authority)
    lifetime = leaf.not_valid_after_utc - leaf.not_valid_before_utc
    assert lifetime.days <= LEAF_DAYS + 1 <= MAX_DAYS
    usage = leaf.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [ExtendedKeyUsageOID.SERVER_AUTH]
    assert isinstance(leaf.public_key().curve, ec.SECP256R1)
    assert not leaf.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    constraints = authority.extensions.get_extension_for_class(x509.BasicConstraints)
    assert constraints.critical
    assert constraints.value.path_length == 0


def test_it_names_every_address_and_the_names_of_the_settings(tmp_path):
    made = certificate(tmp_path, ["robot.lab"])
    assert names_of(load(made.cert)) == {*own_names(), "robot.lab"}


def test_keys_are_for_nobody_else(tmp_path):
    state = tmp_path / "state"
    made = certificate(state)
    keys = sorted(state.glob("*key*"))
    assert len(keys) == 2
    assert {path.stat().st_mode & 0o777 for path in keys} == {0o600}
    assert state.stat().st_mode & 0o777 == 0o700
    assert b"PRIVATE" not in made.authority.read_bytes()
    assert b"PRIVATE" not in made.cert.read_bytes()


def test_a_good_one_is_kept(tmp_path):
    first = certificate(tmp_path).cert.read_bytes()
    assert certificate(tmp_path).cert.read_bytes() == first


def later(days):
    class Later(datetime.datetime):
        @classmethod
        def now(cls, tz=None):
            return super().now(tz) + datetime.timedelta(days=days)

    return Later


@pytest.mark.parametrize(("days", "renewed"), [(0, False), (LEAF_DAYS - 40, False), (370, True)])
def test_it_is_renewed_before_it_ends_by_the_same_authority(tmp_path, monkeypatch, days, renewed):
    before = certificate(tmp_path)
    cert, authority = before.cert.read_bytes(), before.authority.read_bytes()
    monkeypatch.setattr(tls.datetime, "datetime", later(days))
    certificate(tmp_path)
    assert (before.cert.read_bytes() != cert) == renewed
    assert before.authority.read_bytes() == authority


def test_a_new_address_or_name_makes_a_new_one(tmp_path, monkeypatch):
    assert "198.51.100.7" not in names_of(load(certificate(tmp_path).cert))
    monkeypatch.setattr(tls, "_towards_others", lambda: ["198.51.100.7"])
    assert "198.51.100.7" in names_of(load(certificate(tmp_path).cert))
    assert "x.lan" in names_of(load(certificate(tmp_path, ["x.lan"]).cert))


@pytest.mark.parametrize("broken", ["server", "server-key", "ca-key", "ca"])
def test_what_is_lost_or_broken_is_made_again(tmp_path, broken):
    certificate(tmp_path)
    path = tmp_path / f"{broken}.pem"
    if broken == "server":
        path.write_text("rubbish")
    else:
        path.unlink()
    made = certificate(tmp_path)
    load(made.cert).verify_directly_issued_by(load(made.authority))
    key = serialization.load_pem_private_key(made.key.read_bytes(), None)
    assert key.public_key() == load(made.cert).public_key()


def test_a_key_of_another_certificate_is_made_again(tmp_path):
    made, other = certificate(tmp_path / "one"), certificate(tmp_path / "other")
    made.key.write_bytes(other.key.read_bytes())
    certificate(tmp_path / "one")
    key = serialization.load_pem_private_key(made.key.read_bytes(), None)
    assert key.public_key() == load(made.cert).public_key()


def test_a_client_that_trusts_the_authority_connects_by_name_and_address(tmp_path):
    made = certificate(tmp_path)
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(made.cert, made.key)
    trusting = ssl.create_default_context(cafile=made.authority)
    for name in ("127.0.0.1", "localhost"):
        left, right = socket.socketpair()
        with left, right:
            shake = threading.Thread(target=lambda end=left: server.wrap_socket(end, True).close())
            shake.start()
            with trusting.wrap_socket(right, server_hostname=name) as secure:
                assert secure.version() in ("TLSv1.2", "TLSv1.3")
            shake.join()


def test_the_likeliest_address_comes_first_and_loopback_last(monkeypatch):
    monkeypatch.setattr(tls, "_towards_others", lambda: ["192.0.2.9", "fe80::1", "127.0.0.1"])
    monkeypatch.setattr(tls, "_of_interfaces", lambda: ["10.42.0.1", "192.0.2.9", "169.254.1.1"])
    assert own_addresses() == ["192.0.2.9", "10.42.0.1", "127.0.0.1", "::1"]


def test_every_interface_is_found():
    assert "127.0.0.1" in tls._of_interfaces()
