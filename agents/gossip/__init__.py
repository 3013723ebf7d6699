"""Two controllers that demonstrate the radio: the largest id spreads by gossip, and beacons measure links."""

from zwerm.agents.gossip.beacon import Beacon
from zwerm.agents.gossip.gossip_max import GossipMax

__all__ = ["Beacon", "GossipMax"]
