"""Who provides what a deployment needs to have decided, and which providers go together."""

from typing import Final, Literal

from pydantic import BaseModel, ConfigDict

# By who finds the path: who then finds fence and end.
GOES_WITH: Final = {"coordinator": "coordinator", "gradient": "local"}


class ServicesTable(BaseModel):
    """Who provides what: the `coordinator`, or the robots among themselves.

    With `path` `gradient` robots find the frontier, the way to it and the end by themselves; `fence` and `termination` go with
    it. By `redundancy`, who can be spared is found by the coordinator, by relative homology; with `link` by robots, by
    agreement among neighbours; or not at all. A coordinator may find that alone, where robots find the path.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    path: Literal["coordinator", "gradient"] = "coordinator"
    redundancy: Literal["coordinator", "link", "none"] | None = None
    fence: Literal["coordinator", "local"] | None = None
    termination: Literal["coordinator", "local"] | None = None

    @property
    def spares(self) -> str:
        """Who finds redundant robots: where nothing else is said a coordinator that finds the path, and else nobody."""
        return self.redundancy or ("coordinator" if self.path == "coordinator" else "none")

    @property
    def leaving(self) -> bool:
        """Whether robots leave the complex before anybody pushes from where they stand."""
        return self.spares == "link" or (self.path, self.spares) == ("gradient", "coordinator")

    @property
    def centre(self) -> bool:
        """Whether anything is the coordinator's."""
        return "coordinator" in (self.path, self.spares)

    def check(self) -> None:
        """Raise ValueError where providers do not go together."""
        for name, provider in (("fence", self.fence), ("termination", self.termination)):
            if provider not in (None, GOES_WITH[self.path]):
                why = "a way is known to whoever knows where it ends"
                raise ValueError(f"services.{name}: {provider!r} with path {self.path!r}: {why}")
