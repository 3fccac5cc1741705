"""`vsd explain`: messages about engine files (E2xx, W2xx)."""

from __future__ import annotations

from typing import Final

OF_FILES: Final[dict[str, str]] = {
    "E200": """\
An input file cannot be used at all. Single bad rows never stop an import: they go to quarantine.
Fix: as the message says; vsd check FILES shows what is wrong without changing anything.""",
    "E201": """\
There is no such file.
Common causes: a misspelt path; a pattern such as export/*.csv that matches nothing; a folder that was not mounted.
Fix: check the path with ls, then run the command again. Files already read are recognised and counted once.""",
    "E202": """\
The file exists, but lacks what its format must have: it is empty, has no header or lacks a
column that its engine always writes.
Common causes: an export that broke off, the wrong file of a set, a header line that was cut away.
Fix: export it again, or name the format it really has with --format.""",
    "E203": """\
A table lacks a column that is needed.
Positions need ts and x_m, y_m (or u_px, v_px with a calibrated camera); pairs need ts and distance_m or both places.
Fix: --map ours=theirs, or [ingest.map] in vsd.toml; a headerless file needs --columns, our names in order.""",
    "E204": """\
No known format fits the file, or the one that was named does not.
Fix: name the format with --format; for tables, check that it is text in UTF-8 with a header line, or a Parquet file.
JSON messages of any engine are read by --persons and --map; for anything else, write an adapter: docs/plugins.md.
vsd check FILES shows what was recognised.""",
    "E205": """\
The file is damaged: compressed data or a Parquet file that ends early, or an archive that cannot be opened.
Common cause: a copy that broke off. All records before the damage are stored and counted once.
Fix: copy or export it again and ingest it again; what was read already is recognised.""",
    "E206": """\
A compressed file, an archive or a Parquet file would unpack to far more than recordings do, so it was not unpacked.
Common cause: a damaged or malicious file; rarely, a long recording in which nothing ever changes.
Fix: look at it. If it is right, split it, or raise the setting the message names under [ingest] in vsd.toml:
unpack_free_mb (allowed to any file), unpack_ratio_max (times the size on disk) or unpack_max_gb (at most).""",
    "E207": """\
Records have frame numbers, and nothing says when frame 0 was and how many frames a second has.
Without both there is no time, and without time no hour and no week.
Fix: --fps 25 --start 2026-11-09T08:00:00+01:00""",
    "E208": """\
Floor metres were asked for, and the file has none in its world columns.
Fix: use the boxes instead (--coordinates image) with a calibrated camera: vsd calibrate CAMERA.""",
    "E209": """\
A file exceeds a limit that protects memory, disk and time from a single input: records, records that
cannot be read, bytes of a Parquet page or cell. The message says what was found and which setting limits it.
Common cause: a file made to do harm, a wrong format or column, damage. Records before the bound are stored, each once.
Fix: look at the file. If it is right, split it, or raise that setting in vsd.toml and ingest it again.""",
    "E210": """\
The dates of a file can be read in two ways: 10/03/2025 is 10 March in Europe and 3 October in the United States.
No date of the file shows which, as 25/03/2025 would. Nothing was read.
Fix: --time-format with the format that the message gives, or export times as 2025-03-10T09:00:00+01:00.""",
    "E211": """\
A file was not stored, because something about it is almost surely wrong: the message says what, and the warnings
before it give the code of each reason. No record of it was stored, so that no wrong number can be reported.
Fix: run the command again with the option that the message gives. vsd check FILE shows what is understood with it.
If the file is right as it is: --yes.""",
    "E213": """\
The name of a file should say the camera, as camera_from_name of its [[source]] in vsd.toml asks, and it says none that
vsd.toml has, or several. Nothing of the file was read.
Fix: engine_ids = ["its name"] under the [[camera]] that is meant; rename the file; or --camera for this file alone.
Beside a * of the pattern a camera's name ends where a word ends: cam-12 is never read as cam-1.""",
    "W208": """\
One sequence of an archive has no floor metres in its world columns; it was left out, the others were read.
Fix: import it on its own with its boxes and a calibrated camera.""",
    "W209": """\
Something concerns a whole file; the message says what it is. The records of the file were read.
The most serious: pairs rebuilt from an engine's boxes do not agree with the counts it wrote beside them. Most likely
its settings (method, resolution, distance threshold) are other than assumed, and every distance would be off.
Fix: give the engine's own settings, as the message proposes, and import again.""",
    "W210": """\
Some records could not be used and went to quarantine with their reason; all others were read and counted.
Common causes: text in a number column, distances that are not finite or negative, times before 1990 or in the future,
cameras that vsd.toml does not describe, lines that broke off.
Fix: look at the example; correct the export or vsd.toml and ingest again: what was read already counts once.""",
    "W211": """\
Some local times of a file happened twice: clocks were set back, and times without an offset do not say which of the two
hours they mean. The message says how they were read. Or some happened never: clocks were put forward over them, so they
were written by a clock of another zone.
Fix: export times in UTC or with their offset, and set clock of the camera in vsd.toml.""",
    "W212": """\
A file was read to its end and held no record.
Common causes: an export of an hour in which the engine did not run, a filter that left nothing, the wrong file.
Fix: look at the file; if its format was guessed, name it with --format.""",
    "W213": """\
Some records of a file are more than a year away from the others, of the file and of the store. They are read and count.
Common cause: a camera or engine that lost its clock and began again at 1990 or 2000. A history of other years is fine.
Fix: set the clock (NTP), and remove the records: vsd purge --camera ID --range DAYS with the days of the message.""",
    "W220": """\
Positions do not look like metres: people would outrun anybody, be far off the floor, inside each other, or rounded.
Common causes: millimetres, centimetres, feet or yards; pixels, degrees or speeds mapped to x_m y_m; heights as y_m; one
place for people whom the engine has lost; a person twice in a frame; times without their decimals, so that many frames
become one; a plan with a wrong origin or scale; an axis that points the other way, so that people walk through shelves.
Fix: --unit mm, cm or ft; columns that name their unit, such as x_mm, are converted without it. Pixels go to u_px v_px.
A plan is placed by plan_origin_m and plan_m_per_px in vsd.toml; vsd check FILE --picture where.svg shows both.""",
    "W221": """\
A column that is not read, or the names of files, tell of several cameras or floors, and all rows would go to one
camera.
People of different places would then be compared as if they stood on the same floor in view.
Fix: --map camera_id=COLUMN, and engine_ids = ["its name"] under each [[camera]] of vsd.toml; or --where with one of
them, one command for each. Files named after cameras: one command for each, with --camera.""",
    "W222": """\
A column says what each row is, and some rows are no persons, or people whom the engine has lost, or the engine is not
sure of many of them. Or lines of sums are among the rows. Every row that is read counts as a person.
Fix: --where "class_name = 'person'", with the column and word of the file. Rows left out are counted.
A limit of the engine's confidence goes into the same filter: --where "class_name = 'person' and confidence >= 0.4".""",
    "W223": """\
Times have no offset from UTC, and nobody stated their clock, so they are taken as UTC. The message shows what they are
in the site's zone then, what they would be if they were on the site's clock, and how many would be in opening hours.
Or some times have an offset and others none; or the clock goes back by an hour, as at the end of summer time; or hardly
any time is in opening hours: the engine's clock may be that of another zone.
Fix: --zone Europe/Rome, or for good clock = "Europe/Rome" under [[camera]]; clock = "UTC" if UTC is right.""",
    "W224": """\
Many rows name the same person, camera and time at different places. A person has one place at a time, so only one of
such rows is stored, and the others are left out as second sightings. Or each record of a frame has a time of its own:
people are close to each other only in one frame, so nobody would ever be too close. Or several frames have one time,
and people without ids stand beside themselves.
Common causes: dates without the time of day, times without seconds, ids that several people share.
Fix: --map ts=date+time joins two columns; export times with parts of seconds. --period 1 keeps one record a second.""",
    "W225": """\
There are no track ids, or they change with nearly every record. A violation needs the same two people for 3 seconds, so
violations cannot be counted. Records, person-hours and maps are not concerned.
Fix: --map track_id=COLUMN with the id that the engine's tracker gives.""",
    "W226": """\
Positions in the picture are not pixels of it: they are shares of its width and height (0 to 1), or they lie outside it.
Fix: --size 1280x720, the size of the picture, converts shares. Otherwise calibrate the camera with the resolution that
the engine works at, and state that size as picture_px in vsd.toml. A box is two corners, a corner and its size, or its
centre and its size, and pixels are counted from the upper edge down.""",
    "W227": """\
The times cannot be right: they are in another century, or come from a clock of twelve hours without AM and PM, or the
date beside them does not change at midnight. Or they are ten years old to the month, as seconds since 1980 (GPS) are.
Common causes: ticks or days that are not counted from 1970, digits of a date read as a number, a wrong unit.
Fix: export ISO times, or state how they are written: --time-format "%Y%m%d%H%M%S".""",
    "W228": """\
A part of the source is not read: columns of another person in each row, or files of a folder that are no tables.
Or a path of a JSON message takes one entry of a list that has more, such as the first of several cameras.
Fix: one row for each person; --format pairs where a row is two people and their distance. Name other files in a command
of their own; write one message for each camera.""",
    "W229": """\
The first 50,000 records of a source looked right, so it was stored; later ones do not. The message says from about
which line on, and what is wrong there, with the code of that doubt (vsd explain CODE).
Common causes: exports joined in one file, an engine whose settings were changed, a clock that was set.
Fix: vsd purge --import ID removes what the file brought. Cut it where it changes, and import each part as it is.""",
}
