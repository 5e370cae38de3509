"""How generic the onset is, how it depends on the number of disks, and what its statistics owe to the packing."""
