"""The forms an answer leaves in: text, JSON, CSV, frames. Each file renders any answer and knows no figure."""
