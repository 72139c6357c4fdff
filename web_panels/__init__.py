"""The page: panels that draw traces and post commands."""
