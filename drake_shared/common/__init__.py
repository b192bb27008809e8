"""What every room uses: errors, files, arrays and entry points."""
