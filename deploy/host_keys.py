"""The keys of a run over several hosts: one file for the world, and one for each host that runs robots."""

import secrets
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from zwerm.deploy.authority import certify
from zwerm.deploy.identity import WorldKeys, issue, save, save_world_keys, slice_of
from zwerm.deploy.remote import parse_ids
from zwerm.errors import LinkError

WORLD: Final = "world"
ROBOTS: Final = "robots"


def write_host_keys(
    folder: Path, nodes: Sequence[int], names: Sequence[str], hosts: Sequence[str], lease_s: float
) -> list[Path]:
    """Write `world.key`, and `NAME.key` for each of `hosts`, `NAME=IDS`, into the new `folder`; return the paths.

    `names` are the names and addresses by which robots reach the world. Raises LinkError if a node is on no host or on two.
    """
    slices = slices_of(nodes, hosts)
    try:
        folder.mkdir(mode=0o700, parents=True)
    except OSError as error:
        raise LinkError(f"{folder}: cannot make a new folder: {error.strerror}") from None
    identity, credentials = certify(issue(secrets.token_hex(8), nodes, lease_s=lease_s), [*names, "localhost"])
    paths = [folder / f"{WORLD}.key"]
    save_world_keys(WorldKeys(identity, credentials), paths[0])
    for name, chosen in slices.items():
        paths.append(folder / f"{name}.key")
        save(slice_of(credentials, chosen), paths[-1])
    return paths


def slices_of(nodes: Sequence[int], hosts: Sequence[str]) -> dict[str, list[int]]:
    """Return the nodes of each host. Raises LinkError if a node is on no host or on two, or a host has no usable name."""
    if not hosts:
        return {ROBOTS: list(nodes)}
    slices: dict[str, list[int]] = {}
    left = dict.fromkeys(nodes)
    for host in hosts:
        name, equals, ids = host.partition("=")
        if not equals or not name.replace("-", "").replace("_", "").isalnum() or name == WORLD or name in slices:
            raise LinkError(f"--host: expected a new name and its nodes, such as left=0-24, got {host!r:.80}")
        slices[name] = parse_ids(ids, f"--host {name}")
        for node in slices[name]:
            if node not in left:
                raise LinkError(f"--host: {host!r:.80}: the run has no node {node}, or another host has it")
            del left[node]
    if left:
        raise LinkError(f"--host: no host has node {next(iter(left))}")
    return slices
