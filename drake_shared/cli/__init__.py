"""What the subcommands of ``drake-shared`` do, one a module."""
