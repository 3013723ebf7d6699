"""Radio models, one file each. The catalogue names them."""
