"""The mask: everything that may leave the operator's hands is decided in this folder, and nowhere else.

- `periods`: which days may leave at all: ISO weeks that are over.
- `counts`: which counts of a sum are hidden, so that no small one can be worked out.
- `weeks`: what is hidden of a floor's week, in every output that reaches back to it.
- `earlier`: what left before, so that two versions of a week do not tell their difference.
- `hours`, `together`: hours of which readers know a sum only, in all that is computed for them.
- `answers`: the same for answers, by their declared sums.

`mask_below` = 0 is the operator's choice to hide nothing: every command's `--exact` sets it for that command alone.
"""
