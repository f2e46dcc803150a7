"""Many runs at once: each a pure function of its configuration, stored once, never lost."""
