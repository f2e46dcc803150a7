"""How long a part takes, alone and beside others."""
