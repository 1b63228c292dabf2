"""TLS for a LAN: an authority of this installation's own, and a certificate for its addresses."""

from __future__ import annotations

import datetime
import ipaddress
import os
import socket
import struct
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

LEAF_DAYS = 397
AUTHORITY_DAYS = 3650
RENEW_DAYS = 30
SIOCGIFADDR = 0x8915


@dataclass(frozen=True, slots=True)
class Certificate:
    """Files for a TLS server."""

    cert: Path
    key: Path
    authority: Path | None
    """To be installed on phones; None for a certificate of the user's own."""


def own_addresses() -> list[str]:
    """IP addresses by which others may reach this machine, the likeliest first, loopback last."""
    near = [ipaddress.ip_address(text) for text in (*_towards_others(), *_of_interfaces())]
    useful = (str(a) for a in near if not (a.is_loopback or a.is_link_local))
    return [*dict.fromkeys(useful), "127.0.0.1", "::1"]


def _towards_others() -> list[str]:
    """Addresses of the interfaces that lead to the rest of the world."""
    found: list[str] = []
    for target in ("192.0.2.1", "2001:db8::1"):  # documentation addresses: nothing is sent
        family = socket.AF_INET6 if ":" in target else socket.AF_INET
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect((target, 9))
                found.append(probe.getsockname()[0])
            except OSError:
                continue
    return found


def _of_interfaces() -> list[str]:
    """IPv4 addresses of all interfaces, such as a hotspot for the phone; Linux only."""
    if not sys.platform.startswith("linux"):
        return []
    import fcntl

    found: list[str] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode()[:15])
            try:
                answer = fcntl.ioctl(probe, SIOCGIFADDR, request)
            except OSError:  # an interface without an address
                continue
            found.append(socket.inet_ntoa(answer[20:24]))
    return found


def own_names() -> list[str]:
    """Names and addresses this server answers to."""
    host = socket.gethostname().lower()
    return [*own_addresses(), "localhost", host, f"{host}.local"]


def certificate(state: Path, names: Iterable[str] = ()) -> Certificate:
    """The certificate in `state` for this machine and `names`, made or renewed if it must be."""
    wanted = [*own_names(), *names]
    state.mkdir(parents=True, exist_ok=True, mode=0o700)
    paths = {name: state / f"{name}.pem" for name in ("ca", "ca-key", "server", "server-key")}
    if not (paths["ca"].exists() and paths["ca-key"].exists()):
        _make_authority(paths)
    if not _is_good(paths, wanted):
        _make_leaf(paths, wanted)
    return Certificate(paths["server"], paths["server-key"], paths["ca"])


def _is_good(paths: dict[str, Path], wanted: Iterable[str]) -> bool:
    """Whether the certificate is ours, has its key, lasts, and names all that is wanted."""
    try:
        leaf = x509.load_pem_x509_certificate(paths["server"].read_bytes())
        issuer = x509.load_pem_x509_certificate(paths["ca"].read_bytes())
        leaf.verify_directly_issued_by(issuer)
        key = serialization.load_pem_private_key(paths["server-key"].read_bytes(), None)
        if key.public_key() != leaf.public_key():
            return False
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, TypeError, InvalidSignature, x509.ExtensionNotFound):
        return False
    named = {str(name.value) for name in names}
    left = leaf.not_valid_after_utc - datetime.datetime.now(datetime.UTC)
    return left.days > RENEW_DAYS and set(wanted) <= named


def _make_authority(paths: dict[str, Path]) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(f"Lightleash on {socket.gethostname()}")
    certificate_ = (
        _builder(name, name, key, AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    _write(paths["ca"], certificate_.public_bytes(serialization.Encoding.PEM), 0o644)
    _write(paths["ca-key"], _private(key), 0o600)


def _make_leaf(paths: dict[str, Path], wanted: Iterable[str]) -> None:
    authority = x509.load_pem_x509_certificate(paths["ca"].read_bytes())
    authority_key = serialization.load_pem_private_key(paths["ca-key"].read_bytes(), None)
    assert isinstance(authority_key, ec.EllipticCurvePrivateKey)
    key = ec.generate_private_key(ec.SECP256R1())
    names: list[x509.GeneralName] = []
    for name in dict.fromkeys(wanted):
        try:
            names.append(x509.IPAddress(ipaddress.ip_address(name)))
        except ValueError:
            names.append(x509.DNSName(name))
    leaf = (
        _builder(_name("Lightleash"), authority.subject, key, LEAF_DAYS)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()),
            critical=False,
        )
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(_usage(signs=False), critical=True)
        .sign(authority_key, hashes.SHA256())
    )
    _write(paths["server"], leaf.public_bytes(serialization.Encoding.PEM), 0o644)
    _write(paths["server-key"], _private(key), 0o600)


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, days: int
) -> x509.CertificateBuilder:
    now = datetime.datetime.now(datetime.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(days=days))
    )


def _usage(signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common[:64])])


def _private(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def _write(path: Path, data: bytes, mode: int) -> None:
    part = path.with_suffix(".part")
    part.unlink(missing_ok=True)
    with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        file.write(data)
    part.replace(path)
