"""Names of EmbodiChain."""
