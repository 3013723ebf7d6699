"""The models of the radio, one file each; `zwerm.world.radio.registry` names them."""
