"""The read-only HTTP service: figures and pages of the weekly reports for programs and browsers."""
