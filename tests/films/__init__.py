"""Films of pendulums with exact truth, rendered without anything of the product, and scores of readers on them."""
