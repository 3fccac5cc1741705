"""`vsd explain CODE`: what each message means, what usually causes it, how to fix it."""

from __future__ import annotations

from typing import Final

from vsd_analytics.cli.explanations_of_files import OF_FILES
from vsd_analytics.errors import UsageError

EXPLANATIONS: Final[dict[str, str]] = {
    "E100": """\
Something could not be done.
The message says what and where. Messages with this code have no code of their own.""",
    "E101": """\
The command was called with something it cannot use.
Common causes: a misspelt command, option, camera or area; a week that is not like 2026-W46; a range whose end comes
before its start; a time that is not ISO, such as 2026-11-11T12:00.
Fix: the message shows the form; vsd COMMAND --help has an example of every option.""",
    "E102": """\
No project: there is no vsd.toml in this folder or any folder above it.
vsd.toml says which site, cameras and opening hours records belong to; nothing works without it but vsd demo.
Fix: change into the project folder, pass it with -C DIR, or write one with vsd init.""",
    "E103": """\
vsd.toml has mistakes. The message lists all of them at once, each with its line, its own code and a fix.
Nothing was read or changed. Fix them in an editor, then run: vsd doctor.""",
    "E104": """\
There is a vsd.toml already, and vsd init never writes over one.
Fix: edit that file, or start another project in another folder: vsd -C DIR init.""",
    "E106": """\
An installed plug-in that reads a format of its own could not be loaded. Nothing was read.
Common causes: it was made for another version of vsd_analytics, or a library it needs is missing.
Fix: upgrade the package named, or remove it; docs/plugins.md says what a plug-in must have.""",
    "E107": """\
A library is missing that this command needs. vsd init, check, ingest, listen, imports, quarantine, alarms, purge,
export, verify, doctor and log work without it: this is the core installation for the machine beside the cameras.
Fix: pip install vsd-analytics installs everything. Or run the command where everything is installed.""",
    "E110": """\
A line of the change log (log.jsonl) is not an entry, so the whole log is refused rather than read in part.
Common causes: the file was edited by hand, or is not UTF-8.
Fix: correct or delete the line named. An entry is one line:
{"at": "2026-11-11T12:00:00+01:00", "text": "moved the exhibit", "area": "entrance"}""",
    "W110": """\
A line of the change log (log.jsonl) breaks off before its end. It is not read; all other entries are.
Common cause: version 0.1 was stopped, or the disk was full, while it wrote the line. It was not acknowledged.
Fix: vsd log add with the text and time of that entry: it adds the entry and removes the line. Or delete the line.""",
    "E120": """\
The operating system refused a file.
Common causes: no permission, a full disk, a path that is a folder, a file that vanished meanwhile.
Fix: look at the path named, its permissions (ls -l) and the free space (df -h), then run the command again.""",
    "E121": """\
vsd.toml, or a calibration file beside it, is not a text that can be read as TOML.
Common causes: quotes missing around a text, a list without its closing bracket, the same key twice in one table, a
file saved in another encoding than UTF-8.
Fix: the line named; TOML shows one such mistake at a time, all others come after it.""",
    "E122": """\
vsd.toml has a table or key that does not exist.
It is refused rather than ignored, since a misspelt key would silently leave its default in force.
Fix: rename it to the nearest one shown. A name of your own belongs into name = "...", which may be any text.""",
    "E123": """\
vsd.toml lacks something that every site needs.
The smallest site is [site] with id, name and timezone, one [[floor]] with id and name, and one [[camera]] with id and
name. Some keys need a companion: plan needs plan_m_per_px; on a site of several floors each camera and area needs
floor. Fix: add the line shown.""",
    "E124": """\
A value in vsd.toml, or in an environment variable VSD_..., is of the wrong kind or outside its range.
Write texts in quotes and numbers without; every setting has a unit, a smallest and a largest value (vsd doctor
--show-config, docs/settings.md).
Fix: write it as the message shows.""",
    "E125": """\
An id cannot be used, is there twice, or names something that is not described.
Ids become folder and file names: a-z, 0-9, - and _, at most 63, first a letter or digit. Each floor, camera and area
has its own, and one engine id belongs to one camera.
Fix: the nearest known id is shown; display names (name = ...) may be any text.""",
    "E126": """\
A file named in vsd.toml is not there or cannot be used.
Paths start at the folder of vsd.toml; absolute paths are allowed. Plans are SVG, PNG or JPG.
Fix: correct the path, put the file there, or take the line out.""",
    "E127": """\
The opening hours cannot be understood.
Form: opening = { mon-fri = "08:00-21:00", sat = ["09:00-13:00", "15:00-19:00"], sun = "closed" }. Days are mon to sun
or ranges; a day that is not named is closed; times are on quarter hours; the end of a day is 24:00.
A night past midnight is two spans: fri = "18:00-24:00", sat = "00:00-02:00".""",
    "E128": """\
A polygon is not a simple one: it has fewer than three corners, no area, or crosses or touches itself; or it is far
too large (over 250,000 m2 from corner to corner), as when millimetres or pixels were given for metres.
Fix: list each corner once, in the order in which you would walk around it, in floor metres [x, y]; the last corner
joins the first by itself.""",
    "E129": """\
The calibrations of a camera contradict each other.
A camera has homography or points, not both; each of its calibrations begins at another instant (calibrated_from in
vsd.toml, from in calibration/CAMERA.toml), and one without an instant holds since ever. So do planes of one id.
Fix: take one of the two out, or give it a later instant.""",
    "E130": """\
This platform is not supported. The program runs on Linux and macOS with a local disk.
The store promises that what it acknowledged survives a crash, and that two programs never write at once. Both rest on
flock and on renames that are made durable by syncing the folder, which Windows and network file systems lack.
Fix: run it on Linux or macOS, or in WSL with the project on WSL's own disk.""",
    **OF_FILES,
    "E300": """\
The store refused something or found something wrong; nothing that was acknowledged is lost.
Fix: as the message says, then vsd doctor.""",
    "E301": """\
Nothing is stored for this site yet, so there is nothing to count.
Common causes: no file was ingested; all its records went to quarantine; the id of the site in vsd.toml was changed.
Fix: vsd ingest FILES..., then vsd coverage.""",
    "E302": """\
A file of the store or of its spool is damaged, or cannot be folded into the store. Nothing is removed: acknowledged
records stay where they are. A note in store/purge that names something a purge does not remove is refused as well: it
may have come with a project somebody else made.
Common causes: a failing disk, a copy of the store that broke off, a file changed by hand.
Fix: put the file named back from a backup, or move it away and ingest its hour again; then vsd doctor. Facts are
computed from the store: delete a folder facts that has damaged files, and vsd build computes it again.""",
    "E303": """\
The key of a day in secrets/ is damaged. With another key, records of that day that are delivered again would not be
recognised and would count twice, so they are refused.
Fix: restore the file from a backup. Without one, ingest nothing more of that day.""",
    "E304": """\
The disk is full (or your quota is). Only stored records are acknowledged. What the message names was not written;
earlier records are stored and can be read.
Fix: free some space (df -h), then run the same command again; what was read already is recognised. A fold of the spool
gives up store/.ballast first (setting ballast_mb), so that acknowledged records find their place even then.""",
    "W304": """\
The disk is full. The ballast file of the store (store/.ballast, setting ballast_mb) was given up to put acknowledged
records in their place. Nothing is lost, and the next time there will be no ballast.
Fix: free some space soon (df -h); the ballast comes back by itself when there is plenty of room.""",
    "E305": """\
The disk can only be read. Reports and figures whose facts are fresh still work; nothing can be stored or recomputed.
Common causes: mounted read-only on purpose (a backup), or by the system itself after the disk failed.
Fix: dmesg shows which; then mount it for writing and run the same command again.""",
    "E306": """\
The disk reports an error while reading or writing. What could not be synced counts as not stored and was not
acknowledged; it is never synced a second time, since the system may have dropped it after the first.
Fix: look at dmesg and at the disk's health (smartctl), copy the store to another disk, then: vsd verify.""",
    "E307": """\
The store or the facts contain a file that this program did not write. This program does not touch or read it, but a
program of yours that reads the whole folder would.
Common causes: a copy made by hand, a file manager's own files, the store of another site, facts of hours that are gone.
Fix: look at the file named and move it away; facts can be deleted, they are computed again.""",
    "E308": """\
The quarantine of a broker has taken as many records in this UTC day as quarantine_day_max allows. The listener stores
and acknowledges nothing more until the next day begins, so that nothing is lost: the broker holds the messages.
Common causes: an engine that sends a camera vsd.toml does not describe, or another format; a clock that is wrong.
Fix: vsd quarantine list shows the records and why they are bad. Remove the cause, or raise quarantine_day_max under
[ingest] and start vsd listen again, as long as the disk has the room: some 500 bytes a record.""",
    "E310": """\
A purge would remove more than half of what is stored, so nothing was removed.
Common causes: a year or month mistyped; a first purge of a store that was never purged.
Fix: vsd purge ... --dry-run shows what would go; if it is meant, add --force. There is no way back but a backup.""",
    "W310": """\
Some hours of the range were purged: their records are gone and their figures remain as they were sealed. Since then
the settings, cameras, calibrations or queries have changed, so newer hours are computed by other rules.
Fix: nothing is wrong, but do not compare the two. Figures within either part agree with each other.""",
    "W311": """\
Records of the range lie more than a year apart, and nothing is stored between. The days between are left out: they
count neither as recorded nor as missing, and no figure has a row for them.
Common cause: a camera or engine that lost its clock and began again at 1990 or 2000 (vsd doctor names the days).
Fix: remove the records: vsd purge --camera ID --range DAYS. Or ask for the days you mean, with --week or --range.""",
    "E311": """\
A purge waited for a program that reads the store (a report, a query, a notebook), or that program for a purge.
Nobody may see half a purge, so each waits for the other, at most ten minutes.
Fix: close what reads the store, then run the same command again. A lock ends with the program that held it.""",
    "E312": """\
The range of a purge cuts an hour whose records were purged before, so that only its sums are left.
A camera can be removed from the sums of a whole hour, not of some minutes.
Fix: widen the range to whole UTC hours there, as the message shows, or leave that hour out.""",
    "E313": """\
A file below sealed/ is damaged or gone: the facts of a day whose records were purged, or the note that names them.
Nothing can compute them again, so they are not guessed. Common causes: a failing disk, a file changed by hand.
Fix: restore the folder sealed from a backup.""",
    "E314": """\
An import cannot be taken back, because some hours it brought records of were purged by age. Only sums of these hours
are stored, and a sum does not say which file it came from.
Fix: remove the import's cameras from the sums of these hours with the command of the message, then take it back.""",
    "E315": """\
A worker of vsd build --on returned other files than the build asked for, so none of them were published.
Common causes: another version of this program on that machine; the project folder is not the same shared folder, or
not at the same path.
Fix: install the same version everywhere and mount the folder alike. What other workers returned before stays.""",
    "E316": """\
The workers of vsd build --on cannot be used: nobody answers at that address, there are no workers, or they died.
Fix: start scheduler (or master) and workers, then run the same command again. Without --on it computes here.""",
    "E317": """\
Two runs of vsd build --publish wrote to the same bucket at a time, and the other one was first; its facts are current
there, whole. Fix: run the same command again, which publishes the facts of now.""",
    "E318": """\
A bucket cannot be published to: nobody answers at the endpoint, there are no credentials, or they may not write there.
The facts of the project are built all the same, and the bucket has its old build, whole.
Fix: check AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and the name of the bucket, and run it again.""",
    "E400": """\
A calibration cannot be used. Fix: as the message says; vsd calibrate CAMERA --points FILE makes a new one.""",
    "E401": """\
There are too few different points for a calibration: it needs four, and six or more show how good it is.
A point is a spot known twice: u,v in the picture (pixels, right and down) and x,y on the floor (metres, right and up).
Fix: add spots in the corners of the floor the camera sees: tile joints, pillars, feet of shelves.""",
    "E402": """\
The points cannot fix a calibration.
Common causes: they lie on one line, or three of four do; two rows were swapped, so that the floor would fold over the
horizon; x and y were swapped for some points.
Fix: spread the points over the floor and check each row's spot in picture and plan.""",
    "E403": """\
A matrix file is not three rows of three numbers.
It must hold the homography from picture pixels to floor metres, (x, y, w) = H (u, v, 1), as plain text.
Fix: export it again, or give points instead: vsd calibrate CAMERA --points FILE.csv""",
    "E404": """\
A matrix cannot be inverted: it maps the whole picture onto a line or a point of the floor.
Common causes: a row written twice, a row of zeros. Fix: export the matrix again, or give points.""",
    "E405": """\
A file of points cannot be read. Its first line is u,v,x,y; every other line has four numbers:
512,633.5,4.20,7.15 is pixel (512, 633.5) at 4.20 m right and 7.15 m up on the floor.
Fix: the line named.""",
    "E406": """\
A calibration file cannot be read: it is not there, you may not read it, or it is not plain text.
Fix: check the path (on the command line it starts where you are, in vsd.toml at the folder of that file).""",
    "E407": """\
Camera files do not describe a camera above a floor; the message says what is missing. Needed are a camera matrix
(camera_matrix, K), a rotation (rvec, R) and a translation (tvec, T), in one file or several; the floor is z = 0.
Fix: give all files, vsd calibrate CAMERA --camera-file intr.xml --camera-file extr.xml, and their --unit.""",
    "E411": """\
The people of a recording cannot calibrate their camera; the message says why. Nothing was changed.
Common causes: a short recording, a wrong --size, people all at one distance, boxes of half bodies.
Fix: give a longer recording with track ids, or measure points: vsd calibrate CAMERA --points FILE.csv""",
    "E412": """\
Messages and truth cannot be compared: they have no frame, or no track id of a person, in common.
Fix: give the truth of the same recording, with the frame numbers and track ids of the detector's file.""",
    "E413": """\
The straight lines of a picture do not show how the camera looks; the message says why. Nothing was changed.
Common causes: few long edges, a round or winding place, a lens that bends lines, a camera that looks straight down.
Fix: click points (vsd calibrate CAMERA --draw), or give an empty picture with floor, shelves and walls.""",
    "W401": """\
The calibration comes from few points. Four points always fit exactly, so their error says nothing, and with
five an error of one is spread over all. Fix: measure six or more, spread over the floor.""",
    "W402": """\
A point is off by more than 30 cm: distances near it are off as well.
Common causes: a spot clicked above the floor (a table instead of its foot), swapped rows, x and y swapped, a lens that
bends straight lines. Fix: look at the red arrows of the overlay picture, then measure that point again.""",
    "W403": """\
The new calibration is written but not used yet: vsd.toml or the camera's history names another file for the
same time. Fix: put the line shown into vsd.toml instead of the old one, or give --from.""",
    "W404": """\
The new calibration replaces one that held for the same time, so old records are placed again as well. That is right
when the old one was wrong. If the camera was moved, give the time of the move, so that both hold: --from INSTANT.""",
    "W405": """\
The people that a camera sees no longer fit its calibration since some hour: somebody probably knocked or turned it.
Distances since then are off by about the share shown. Fix: hang it as it was, or run the command shown, which
calibrates it again from that hour on. Weeks before and after are then not compared with each other.""",
    "E500": """\
A report could not be made; the message says which part and why. Stored data are not touched.""",
    "E501": """\
A plan or camera picture cannot be decoded. Fix: export it as PNG again and name that file in vsd.toml.""",
    "E502": """\
An SVG plan is too large to be carried inside a report. Fix: save it as PNG and name that in vsd.toml.""",
    "E510": """\
vsd site build found no report to list: no 2026-W46.json, nor a page, in the folder reports of the project.
The index is made from the JSON files of the weekly reports and from nothing else.
Fix: vsd site build --make writes the reports of all stored weeks first; vsd report --format html,json that of one.""",
    "W510": """\
The JSON file of a weekly report is damaged and is not listed; everything else is.
Common causes: a copy that broke off, an editor, a merge. The message says what does not fit.
Fix: write it again with vsd report --week WEEK --format json, while its records or sealed figures are still there.""",
    "W511": """\
A JSON file among the reports is not that of a weekly report, or is that of another week or floor than its name
says, and is not listed. Their names are 2026-W46.json, or 2026-W46-ground.json on sites of several floors.
Fix: move it to another folder, or give it back its name.""",
    "W512": """\
The JSON file of a report was written by a newer version of vsd-analytics, in a form that this version does not know.
It is not listed.
Fix: upgrade this installation, or build the index with the newer one.""",
    "W513": """\
A page among the reports has no JSON file, so the index links to it without its figures.
vsd site build writes the JSON file itself where the records still give the very same page. They do not here.
Common causes: data came or a setting changed since the page was written; the records are purged.
Fix: vsd report --week WEEK --format html,json writes both again.""",
    "W514": """\
Two JSON files report the same week of the same floor; the one made later is listed.
Common cause: a second floor was added to the site, so that 2026-W46.json became 2026-W46-ground.json.
Fix: delete the files of the older one.""",
    "E515": """\
At the place of the index there is an index.html that vsd site build did not write. It is not overwritten.
Fix: choose another folder with --out, or move that file.""",
    "E520": """\
There is no browser to print the PDF with. It is the page itself, printed by a Chromium, Chrome or Edge of this machine.
It is looked for in the environment variable VSD_CHROMIUM, under [report] chromium in vsd.toml, on the PATH, and among
the apps of macOS; one that is named and does not exist is not replaced by another.
Fix: install one (Debian: apt install chromium; Fedora: dnf install chromium; macOS: brew install --cask chromium),
name it, or print the HTML page from any browser. A mail goes out without a PDF meanwhile.""",
    "E521": """\
The browser did not print the PDF: it did not start, failed, or took longer than a minute.
Common causes: a snap, which may not read temporary folders (set TMPDIR to a folder in your home); no user namespaces in
a container, so that its sandbox cannot start; too little memory.
Fix: the message carries the browser's last words. Another browser: VSD_CHROMIUM=/path/to/chromium.""",
    "E522": """\
This figure has nothing to draw for the week: no map without data, no change without a week before.
Fix: vsd report shows what the week has; another --figure, or another --week.""",
    "E600": """\
A SQL query failed. The message carries the database's own words.
Fix: vsd schema tables shows tables and columns; queries are read-only.""",
    "E601": """\
A SQL file of the product does not keep to the form of its header (name, grain, reads, columns), or files
read each other in a circle. It is a mistake in that file, not in your data; the message names the line.""",
    "E602": """\
A SQL file returns other columns than its header declares. It is a mistake in that file, not in your data:
correct the header or the query so that both say the same.""",
    "E603": """\
A query of your own could not be run; the database's own words follow in the message.
Queries may read the store and the facts of this project and nothing else: no other file, no network, no setting.
Fix: vsd sql --list shows the relations, vsd sql --show NAME the text of one, vsd schema tables the columns.""",
    "E604": """\
DuckDB, the database inside this program, failed inside itself on a query, and again with plainer plans. The message
names the relation, the hours and the most crowded frame there, which is the likely cause. The store is left as it is.
Common causes: a frame with far more people than a camera can see, such as records of a whole day under one instant.
Fix: look at that frame; if it is wrong, take it out with vsd purge --camera, correct its file and ingest it again.
persons_max and pairs_max under [ingest] keep such frames out. If the frame is right, report what vsd -v prints.""",
    "E700": """\
The live branch cannot go on. Fix: as the message says.""",
    "E701": """\
The listener has no connection to the broker of [mqtt].
Common causes: the broker is not running, or not reachable from this machine (firewall, listener bound to 127.0.0.1);
host or port are wrong; it refuses user or password; its certificate is not trusted, or names another host.
Fix: vsd doctor shows what the broker answers. A listener without --connect-timeout goes on trying.""",
    "E702": """\
Another client connected to the broker with the listener's client id, so the broker closed the listener's connection.
Two listeners would disconnect each other for ever, so this one stopped. Nothing acknowledged is lost; messages that
were not acknowledged go to the other client.
Common causes: a second machine with a copy of the project, a test left running.
Fix: stop one of the two, or give them different client_id under [mqtt].""",
    "E703": """\
vsd.toml names no MQTT broker. Fix: add [mqtt] with host = "localhost"; docs/live.md shows all keys.""",
    "E704": """\
The password of the broker cannot be read. It must be on the first line of password_file, or in the environment variable
VSD_MQTT_PASSWORD, and never in vsd.toml.""",
    "E705": """\
The certificates of [mqtt] cannot be used: a file is not PEM, is not readable, or key_file does not belong to cert_file.
Fix: openssl x509 -in FILE -noout -text shows a certificate; docs/live.md shows how to make a set.""",
    "E706": """\
A listener of this project runs on this machine already. Two would share one session and take it from each other.
Fix: vsd doctor shows its process id; stop it (systemctl stop vsd-listen), or leave it running.""",
    "E707": """\
Another process watches this folder, or one folder was given to two projects. Two would take each other's files away.
Fix: stop the other one (vsd doctor shows its process id), or watch another folder.""",
    "E708": """\
At least 20 messages in a row have times more than live_late_max_s before this machine's clock, or live_ahead_max_s
ahead of it, and none was within. The messages are safe: they are acknowledged, and whole in quarantine.
Common causes: a wrong clock of this machine or of the engines; messages that waited longer than live_late_max_s.
Fix: date -u shows this machine's clock; timedatectl set-ntp true sets it by a time server. Start vsd listen again.
Then  vsd --now INSTANT quarantine replay --reason time-out-of-range  takes in the messages of the day before INSTANT;
repeat it for each day. If the engines' clocks are wrong, set those: times cannot be corrected afterwards.""",
    "E709": """\
vsd listen --http cannot listen at the address named.
Common causes: another program (or another listener) has the port; a port below 1024; an address of another machine.
Fix: name another port, vsd listen --http 127.0.0.1:8766. ss -ltnp shows which program has one.""",
    "E710": """\
An alarm, or a figure of vsd today --publish, could not be delivered. An alarm is in alarms.jsonl all the same, unless
it was the sample of vsd alarms --test.
Common causes: a wrong address or port; the receiver is down, slow or wants another token (VSD_WEBHOOK_TOKEN); its
certificate is not trusted; it redirects to another address, which is not followed, since the token would go there too.
Fix: the message carries the receiver's own answer. Then: vsd alarms --test""",
    "E800": """\
The weekly mail could not be sent. Fix: as the message says. The .eml file beside it can be sent by hand.""",
    "E801": """\
There is no way to send a mail, or nobody to send it to. vsd report --mail writes an .eml file without either.
Fix: in vsd.toml [mail] with smtp = "mail.example.org" (or sendmail = "/usr/sbin/sendmail"), from = "..." and
to = ["..."]; docs/mail.md shows all keys.""",
    "E802": """\
The password of the mail server cannot be read. It must be in the environment variable VSD_MAIL_PASSWORD, or on the
first line of password_file, which lies outside the project; never in vsd.toml.""",
    "E803": """\
The mail server cannot be reached, or went away before it took the mail. It was tried three times; nothing was sent.
Common causes: smtp or port are wrong, the server is down, a firewall, the wrong kind of encryption for the port.
Fix: run the same command again later, by hand or by the timer; nobody gets a week twice.""",
    "E804": """\
No encrypted connection to the mail server: it offers none, or its certificate is not trusted, or names another host.
Nothing was sent, and the password was not shown to anybody.
Fix: tls = "starttls" goes with port 587, tls = "tls" with 465. A certificate of your own authority: ca_file. A server
on this machine or in a closed network without encryption: tls = "none", which allows no login.""",
    "E805": """\
The mail server refuses user or password; its own words follow in the message. Nothing was sent.
Common causes: a provider that wants a password made for programs; a user that is not the whole address.
Fix: [mail] user; the password in VSD_MAIL_PASSWORD or password_file.""",
    "E806": """\
The mail server refuses the sender, the mail, or recipients; its own words follow in the message.
If it accepts some recipients and refuses others, the accepted ones have the mail; the next run of the command tries
only the others.
Common causes: a misspelt address; a server that relays only for logged-in senders; a mail that is too large.
Fix: [mail] from and to.""",
    "E807": """\
The server took the whole mail, and the connection broke before it said whether it will deliver it. It may have arrived.
Sending it again by itself could deliver it twice, so it is not done.
Fix: ask a recipient. If it did not come: the same command with --again. mail/sent.jsonl lists what was begun.""",
    "E808": """\
The mail program of [mail] sendmail did not take the mail. Nothing was sent.
Fix: run it by hand once; its own log (journalctl -u postfix, /var/log/mail.log) says more.""",
    "E809": """\
Another command is sending mail of this project at this moment.
Fix: wait until it ends, then run this one again: what was sent is not sent twice.""",
    "W800": """\
The week the clock calls the last one has no data yet, so --week last means an older one. That one was mailed already,
or is mailed late; the newest week is not mailed.
Fix: see why no data come (vsd doctor, vsd coverage); once they are there, run the same command again. To mail the week
as it is, name it: --week 2026-W46. Then the mail says that there are no data.""",
    "W801": """\
The mail has no PDF, as no browser could print it; everything else is in it.
Fix: vsd doctor shows which browser it found; install Chromium, or name one: VSD_CHROMIUM=/path/to/chromium.""",
    "E900": """\
An internal error: a mistake in this program, not in your data. The store is left consistent.
Fix: run the command again with -v and report the traceback it prints, after reading it for private names.""",
}


def explanation(code: str) -> str:
    """Return what a code means, its common causes, and how to fix them.

    Args:
        code: Such as "E201", in any case.

    Raises:
        UsageError: No message has this code (E101).
    """
    from vsd_analytics.config.reader import nearest

    known = EXPLANATIONS.get(code.strip().upper())
    if known is not None:
        return known
    close = nearest(code, [each.lower() for each in EXPLANATIONS])
    fix = f"vsd explain {close.upper()}" if close else "vsd explain   (lists all codes)"
    raise UsageError(f"no message has the code {code!r}", fix=fix)
