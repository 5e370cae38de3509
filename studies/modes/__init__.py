"""Complex modes over the load: their number, their growth rates, and the loss of a contact that stops them."""
