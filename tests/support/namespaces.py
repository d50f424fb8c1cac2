"""Machines of a network, as network namespaces of this one (Linux, as root, iproute2): a bridge, and a link to each."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime, timedelta
from ipaddress import IPv4Address
from pathlib import Path


def cannot() -> str:
    """Why there can be none here, or nothing."""
    if sys.platform != "linux" or os.getuid() != 0 or not shutil.which("ip"):
        return "only root makes network namespaces, on Linux, with iproute2"
    name = f"slipsweep-{os.getpid()}"
    try:
        _ip("netns", "add", name)
        _ip("-n", name, "link", "add", "bridge", "type", "bridge")
    except subprocess.CalledProcessError as error:
        return f"the system makes no network namespaces: {error.stderr.strip()}"
    finally:
        subprocess.run(["ip", "netns", "delete", name], capture_output=True, check=False)
    return ""


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


class Machine:
    """One of them, with its name and address; `network` is that of the first, which has the bridge."""

    def __init__(self, number: int, network: str) -> None:
        self.number, self.network = number, network
        self.name = f"{network}-{number}" if number else network
        self.address = str(IPv4Address("10.77.0.1") + number)

    def command(self, *words: str, without: Path | None = None) -> list[str]:
        """A command on this machine; the folder `without` is empty there."""
        hidden = ["sh", "-c", 'mount -t tmpfs tmpfs "$0" && exec "$@"', str(without)] if without else []
        return ["ip", "netns", "exec", self.name, *hidden, *words]

    def link(self, state: str) -> None:
        """Pull its plug (down), or put it back (up)."""
        _ip("-n", self.network, "link", "set", f"port{self.number}", state)

    def received(self) -> int:
        """Bytes that have come in over its link."""
        path = "/sys/class/net/eth0/statistics/rx_bytes"
        return int(subprocess.run(self.command("cat", path), check=True, capture_output=True, text=True).stdout)


@contextmanager
def machines(count: int) -> Iterator[Sequence[Machine]]:
    """Machines that reach each other by nothing but their links."""
    made = [Machine(number, f"slipsweep-{os.getpid()}") for number in range(count)]
    hub = made[0]
    with ExitStack() as stack:
        for machine in made:
            _ip("netns", "add", machine.name)
            stack.callback(_ip, "netns", "delete", machine.name)
            _ip("-n", machine.name, "link", "set", "lo", "up")
        _ip("-n", hub.name, "link", "add", "bridge", "type", "bridge")
        _ip("-n", hub.name, "address", "add", f"{hub.address}/24", "dev", "bridge")
        _ip("-n", hub.name, "link", "set", "bridge", "up")
        for machine in made[1:]:
            port = f"port{machine.number}"
            _ip("-n", hub.name, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", machine.name)
            _ip("-n", hub.name, "link", "set", port, "master", "bridge", "up")
            _ip("-n", machine.name, "address", "add", f"{machine.address}/24", "dev", "eth0")
            _ip("-n", machine.name, "link", "set", "eth0", "up")
        yield made


def certified(folder: Path) -> dict[str, str]:
    """Make a certificate that signs itself; dask's settings by which all connections are encrypted with it."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "slipsweep")])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    public, private = folder / "public.pem", folder / "private.pem"
    public.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    private.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    tls = "DASK_DISTRIBUTED__COMM__TLS"
    settings = {f"{tls}__CA_FILE": str(public), "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "true"}
    for role in ("CLIENT", "SCHEDULER", "WORKER"):
        settings |= {f"{tls}__{role}__CERT": str(public), f"{tls}__{role}__KEY": str(private)}
    return settings
