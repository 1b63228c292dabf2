"""What an authority of ours may sign for: X.509 name constraints, RFC 5280 section 4.2.1.10.

Who steals its key can then deceive the phones that trust it about this machine and about devices
with private addresses, and not about a bank. All private ranges are in it because addresses change
with every network, and a new authority has to be installed on every phone.
"""

from __future__ import annotations

from collections.abc import Iterable
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network

from cryptography import x509

PRIVATE = tuple(
    map(
        ip_network,
        (
            *("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16"),
            *("100.64.0.0/10", "127.0.0.0/8", "::1/128", "fc00::/7", "fe80::/10"),
        ),
    )
)


def general_name(name: str) -> x509.GeneralName:
    """An address or a host's name as certificates write it."""
    try:
        return x509.IPAddress(ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def authority_limits(names: Iterable[str]) -> x509.NameConstraints:
    """Constraints to `names` (hosts and addresses; of IPv6 64 bits) and to private addresses."""
    hosts: dict[str, None] = {}
    networks: dict[IPv4Network | IPv6Network, None] = dict.fromkeys(PRIVATE)
    for name in names:
        try:
            address = ip_address(name)
        except ValueError:
            hosts[name.lower().removeprefix("*.")] = None
            continue
        if not any(address.version == net.version and address in net for net in PRIVATE):
            networks[ip_network((address, 64 if address.version == 6 else 32), False)] = None
    permitted = [*map(x509.DNSName, hosts), *map(x509.IPAddress, networks)]
    return x509.NameConstraints(permitted_subtrees=permitted, excluded_subtrees=None)


def is_permitted(name: str, permitted: Iterable[x509.GeneralName]) -> bool:
    """Whether an authority so limited may sign for `name`."""
    try:
        address = ip_address(name)
    except ValueError:
        host = name.lower().removeprefix("*.")
        domains = (one.value for one in permitted if isinstance(one, x509.DNSName))
        return any(host == domain or host.endswith(f".{domain}") for domain in domains)
    networks = (one.value for one in permitted if isinstance(one, x509.IPAddress))
    return any(
        isinstance(net, (IPv4Network, IPv6Network))
        and net.version == address.version
        and address in net
        for net in networks
    )
