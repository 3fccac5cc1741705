"""The reference engine: joints or boxes of people in a picture in, floor positions and close pairs out."""
