"""Services: the parts of an algorithm that either the coordinator or the robots provide, and the variant that follows."""

from collections.abc import Mapping

from zwerm.catalogue import Algorithm, Variant


def choose(row: Algorithm, given: Mapping[str, str]) -> Variant:
    """Return the first variant of `row` that agrees with every provider in `given`.

    Raises ValueError, in one line that starts with the path of the mistake, where there is none.
    """
    known = list(row.variants[0].services) if row.variants else []
    for service, provider in given.items():
        if service not in known:
            expected = " or ".join(known) or "no services"
            raise ValueError(f"services.{service}: {row.name} has {expected}, got {service!r}")
        providers = list(dict.fromkeys(variant.services[service] for variant in row.variants))
        if provider not in providers:
            raise ValueError(f"services.{service}: expected {' or '.join(map(repr, providers))}, got {provider!r}")
    for variant in row.variants:
        if all(variant.services[service] == provider for service, provider in given.items()):
            return variant
    chosen = ", ".join(f"{service}={provider}" for service, provider in given.items())
    raise ValueError(f"services: {row.name} has no variant with {chosen}")


def lacking(variant: Variant, coordinator: bool, radio: bool, stations: int) -> str:
    """Return what a scenario lacks to run `variant`, as one line that starts with the path, or an empty text.

    `coordinator` and `radio` are true if the scenario has these tables; `stations` is its number of base stations.
    """
    chosen = ", ".join(f"{service}={provider}" for service, provider in variant.services.items())
    if variant.coordinator and not coordinator:
        return f"services: {chosen} needs the table [coordinator]"
    if variant.radio and not radio:
        return f"services: {chosen} needs the table [radio]"
    if variant.stations_max is not None and not 1 <= stations <= variant.stations_max:
        return f"services: {chosen} needs 1 to {variant.stations_max} base stations, got {stations}"
    return ""
