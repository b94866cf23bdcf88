"""The proof: the paper's figures remade, and independent oracles that must agree."""
