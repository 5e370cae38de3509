"""Complex modes over the load: how many there are, how fast they grow, and how lossy a contact must be to stop them."""
