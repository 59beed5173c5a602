# SPDX-License-Identifier: Apache-2.0
"""Which names and addresses of hosts mean this machine alone."""
from ipaddress import ip_address


def is_loopback(host: str) -> bool:
    """Whether a host is this machine by "localhost", or by an address of IPv4, of IPv6, or of IPv4 written as IPv6."""
    try:
        address = ip_address(host)
    except ValueError:
        return host == "localhost"
    return (getattr(address, "ipv4_mapped", None) or address).is_loopback
