"""Predicted figures of a changed layout, from the people recorded, and how the predictions came out."""
