"""Drawings as inline SVG and picture files."""
