"""The version, where everything that writes it down can have it without importing the package."""

__version__ = "0.1.0"
