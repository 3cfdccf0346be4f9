"""The effects of the library, a file each; every file defines ``EFFECT``."""
