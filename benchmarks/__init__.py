"""What the package's speed is measured against."""
