"""Who provides what a deployment needs to have decided."""

from typing import Literal

from pydantic import BaseModel, ConfigDict


class ServicesTable(BaseModel):
    """Who provides what: the `coordinator`, or the robots among themselves. Every combination can be run.

    With `path` `gradient` robots find the way to the frontier by themselves, and with it fence and frontier, where it ends, and
    that all is over, when there is none. By `redundancy`, who can be spared is found by the coordinator, by relative
    homology; with `link` by robots, by agreement among neighbours; or not at all. A coordinator may find that alone.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    path: Literal["coordinator", "gradient"] = "coordinator"
    redundancy: Literal["coordinator", "link", "none"] | None = None

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
