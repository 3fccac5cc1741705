"""Columns whose names tell what they hold, though nobody mapped them: cameras, ids, classes, confidences, times."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from typing import Final, Literal

Role = Literal[
    "camera",
    "id",
    "class",
    "confidence",
    "date",
    "time",
    "file",
    "storey",
    "third axis",
    "distance",
    "absent",
    "present",
    "state",
    "unseen",
    "unit",
    "scores",
]


POINTS: Final = frozenset(
    ("p", "pos", "position", "xy", "xyz", "point", "location", "loc", "coord", "coords", "coordinates", "centroid")
)
"""Names of what holds x and y together."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_NAMES: Final[dict[Role, frozenset[str]]] = {
    "camera": _words(
        "camera cameraid cameraname camerano cameranumber cam camid camname camno sensor sensorid sensorname stream "
        "streamid streamname view viewid viewname source sourceid sourcename device deviceid devicename channel "
        "channelid videoid video feed feedid telecamera telecameraid idtelecamera kamera kameraid kameraname camara "
        "idcamara sensore capteur kanal cameraserial deviceserial ip ipaddress host hostname "
        "gerat geraet gerateid geraeteid dispositivo iddispositivo apparecchio appareil dispositif apparaat "
        "摄像头 摄像机 相机 カメラ камера 카메라"
    ),
    "id": _words(
        "id person personid personnumber persons pid track tracks trackid tid trackerid trackingid trackingnumber "
        "tracknumber trackno objectid objid oid object obj who name uid uuid subject subjectid pedestrian pedestrianid "
        "pedid target targetid tag tagid "
        "agent agentid actor actorid player playerid visitor visitorid occupant occupantid bodyid entityid "
        "identity globalid persona idpersona personaid personne idpersonne traccia idtraccia "
        "soggetto piste spur spurid sujet pessoa idpessoa osoba idosoby persoon kisi henkilo 人物id 目标编号 行人id "
        "customer customerid kunde kunden besucher gast cliente idcliente client visiteur visitante visitatore"
    ),
    "class": _words(
        "class classname classid classlabel cls clsname clsid label labelname category categoryid categoryname "
        "objecttype objtype objectclass objclass detectionclass predictedclass kind type classe clase klasse "
        "objektklasse categoria kategorie categorie tipo typ species objekttyp objektart "
        "tipooggetto tipoobjeto typeobjet 类别 类型 类 目标类型 分类 種類 クラス класс тип 종류 클래스"
    ),
    "confidence": _words(
        "confidence conf score prob probability detectionconfidence detectionscore detconf trackconfidence "
        "confidencescore personprobability personscore personconfidence confidenza confiance confianza konfidenz"
    ),
    "date": _words("date day data datum localdate fecha giorno jour"),
    "time": _words("time timeofday clock uhrzeit zeit tiempo localtime hour heure hora ora orario"),
    "file": _words(
        "file filename filepath path image img imagename imagepath imagefile videoname videopath videofile topic "
        "mqtttopic url"
    ),
    "storey": _words(
        "floor floorid floorname floorno level levelid storey story etage stockwerk geschoss planta piano piso "
        "verdieping"
    ),
    "third axis": _words("z zm zmm zcm zft posz positionz worldz zpos zposition elevation"),
    "distance": _words(
        "distance dist separation spacing abstand entfernung distanza distancia distancem distancecm distancemm "
        "distanceft distancefeet distm distcm distmm distft abstandm abstandcm distanzam distanzacm"
    ),
    "absent": _words(
        "lost islost outside outsideview invisible deleted predicted ispredicted extrapolated falsepositive "
        "isfalsepositive ghost isghost interpolated isinterpolated"
    ),
    "present": _words(
        "valid isvalid visible isvisible isperson ishuman isreal confirmed isconfirmed infov inview isdetected"
    ),
    "scores": frozenset(),
    "unseen": _words("timesinceupdate framessinceupdate missedframes lostframes framessincedetection"),
    "unit": _words("unit units uom lengthunit positionunit coordinateunit einheit unita unidad unite"),
    "state": _words(
        "state status trackstate trackstatus trackingstate trackingstatus trackerstate trackerstatus quality flag"
    ),
}

_SCORES: Final = _words("p prob probability score conf confidence pct percent")
"""Words beside that of a class, in a name of scores: `p_person`."""

_LENGTH_UNITS: Final = ("m", "mm", "cm", "dm", "km", "ft", "in", "yd")

_PLACES: Final = (
    (
        "left top right bottom",
        "x1 y1 x2 y2",
        "x0 y0 x1 y1",
        "xmin ymin xmax ymax",
        "minx miny maxx maxy",
        "xtl ytl xbr ybr",
        "left top right bottom",
    ),
    (
        "center_x center_y width height",
        "xcenter ycenter width height",
        "centerx centery width height",
        "xcentre ycentre width height",
        "xc yc w h",
        "cx cy w h",
        "xcenter ycenter w h",
        "centerx centery w h",
    ),
    ("left top width height", "x y w h", "x y width height", "left top width height", "left top w h"),
    (
        "x_m y_m",
        *(f"{front}x{unit} {front}y{unit}" for front in ("", "pos") for unit in _LENGTH_UNITS),
        "worldx worldy",
        "floorx floory",
        "groundx groundy",
    ),
    ("u_px v_px", "upx vpx", "xpx ypx", "xpixel ypixel", "footx footy", "u v"),
    (
        "x_m y_m",
        "x y",
        "xcenter ycenter",
        "posx posy",
        "positionx positiony",
        "xpos ypos",
        "xposition yposition",
        "px py",
    ),
)
"""Names of columns that hold a place together, and ours: boxes first."""

_NEXT: Final = {"x2": "x3", "x1": "x2"}
"""Where numbers of corners go on, they number people: `x1,y1,x2,y2,x3,y3`."""

_INSTANTS: Final = (
    *(
        "ts",
        "timestamp",
        "time",
        "datetime",
        "zeitstempel",
        "horodatage",
        "dataora",
        "fechahora",
        "utc",
        "epoch",
        "date",
    ),
    *("when", "at", "t", "zeit", "zeitpunkt", "ora", "orario", "hora", "heure"),
    *("frametime", "eventtime", "detectedat", "recordedat", "capturedat"),
    *("czas", "tijd", "zaman", "aika", "tempo", "время", "时间", "時刻", "日時", "시간"),
)
"""Names of instants, the surest first."""

_NUMBER_ENDS: Final = re.compile(r"(?:number|nummer|numero|num|no|nr)$")
"""What a name of ids may end in: `Person-Nr.`."""
_CLOCK_ENDS: Final = re.compile(r"(?:sec|seconds|millis|ms|us|ns|s)$")
"""What a name of instants may end in: `timestamp_us`."""

_FAINT_IDS: Final = ("name", "object", "obj")
"""Names of ids that often hold a class instead."""

PERSON: Final = _words(
    "person persons people pedestrian pedestrians ped peds human humans man woman adult child "
    "persona persone personas personne personnes personen persoon pessoa pessoas mensch menschen pedone pedoni pieton "
    "pietons peaton peatones fussganger "
    "fuganger uomo donna 人 行人 人员 人物 歩行者 человек пешеход 사람 보행자"
)
"""Words for what is counted, as classes of detectors name it."""

GONE: Final = _words(
    "lost deleted removed terminated dead gone invisible hidden coasted coasting predicted extrapolated interpolated "
    "bad invalid"
)
"""States of a track whom the tracker does not see."""

SUMS: Final = _words(
    "total totals sum sums mean average avg median count min max std subtotal gesamt summe mittelwert anzahl totale "
    "somma media totaux somme moyenne promedio suma"
)
"""Words with which programs begin a line of sums below a table."""

VAGUE: Final = frozenset({"kind", "type", "tipo", "typ"})
"""Names of columns that hold anything: they name classes only where a class of objects is in them."""

OBJECTS: Final = _words(
    "bicycle bike biker cyclist skater rider "
    "car motorcycle motorbike bus train truck van vehicle veh dog cat bird cart trolley chair face head "
    "backpack handbag suitcase auto autos macchina camion carro coche voiture velo bici bicicleta bicicletta fahrrad "
    "hund chien cane perro carrello chariot caddie poussette stroller kinderwagen passeggino vehicule fahrzeug veicolo "
    "moto motorrad scooter forklift gabelstapler muletto robot mannequin manichino"
)
"""Classes of detectors that are no person."""


def is_named_like(name: str, role: Role) -> bool:
    """Return whether a column's name says that it holds this, whatever its case, blanks, signs, or front (`p.id`)."""
    last = name.strip(" .").rpartition(".")[2]
    if role == "scores":
        return scored_class(last) is not None
    spellings = {letters(name), letters(last), last.strip().lower()}
    if role == "confidence" and letters(last) not in PERSON and scored_class(last) in PERSON:
        return True
    if role == "id":
        spellings |= {_NUMBER_ENDS.sub("", word) for word in spellings}
    return not _NAMES[role].isdisjoint(spellings)


def named_like(names: Iterable[str], role: Role) -> list[str]:
    """Return the names that say that their columns hold this, in their order."""
    return [name for name in names if is_named_like(name, role)]


def scored_class(name: str) -> str | None:
    """Return the class whose score a column of this name may hold: `car`, `p_car` and `carScore` are cars; or None."""
    words = re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", unaccented(name)))
    named = [word for word in map(str.lower, words) if word not in _SCORES]
    return named[0] if len(named) == 1 and named[0] in PERSON | OBJECTS else None


def ids_like(names: Iterable[str]) -> list[str]:
    """Return the names that say that their columns hold the id of a track, the surest first: `trackId` before `id`."""
    given = list(names)
    classes = named_like(given, "class")
    return sorted((n for n in named_like(given, "id") if n not in classes), key=_faintness)


def _faintness(name: str) -> int:
    last = letters(name.rpartition(".")[2])
    if last in _FAINT_IDS:
        return 3
    return 0 if last.startswith("tr") or last == "tid" else 2 if last in ("id", "uid", "uuid") else 1


def time_like(names: Iterable[str]) -> str | None:
    """Return the name that says most surely that its column holds an instant, or None."""
    last = {name: name.rpartition(".")[2] for name in reversed(list(names))}
    by_letters = {word: name for name, part in last.items() for word in (part.strip().lower(), letters(part))}
    by_letters = {_CLOCK_ENDS.sub("", word): name for word, name in by_letters.items()} | by_letters
    return next((by_letters[name] for name in _INSTANTS if name in by_letters), None)


def place_like(names: Iterable[str]) -> dict[str, str]:
    """Return which columns hold a place, as the value of `--map`: ours = theirs; {} when no names say so.

    A box in the picture comes first: `x` and `y` alone may be metres or pixels.
    """
    known = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in reversed(list(names))}
    for ours, *theirs in _PLACES:
        for wanted in (text.split() for text in theirs):
            for front in ("", "bbox", "box", "bb", "bboxes", "rect"):
                next_person = next((front + _NEXT[name] for name in wanted[2:] if name in _NEXT), None)
                if all(front + name in known for name in wanted) and next_person not in known:
                    return {o: known[front + name] for o, name in zip(ours.split(), wanted, strict=True)}
    return {}


def are_columns(names: Iterable[str]) -> bool:
    """Return whether these names say when and where somebody is, as the header of a table does."""
    given = [name.strip() for name in names]
    return bool(place_like(given)) and (time_like(given) is not None or bool(named_like(given, "date")))


def letters(text: str) -> str:
    """Return the letters of a text in lower case, without accents."""
    return re.sub(r"[^a-z]", "", unaccented(text).lower())


def unaccented(text: str) -> str:
    """Return a text with plain letters for those with accents."""
    if text.isascii():
        return text
    return "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))


_MOTION: Final = re.compile(
    r"(?:v|vel|velocity|speed|a|acc|accel|acceleration)[xyz]|[xyz](?:vel|velocity|speed|acc|accel|acceleration)"
)
_DEGREES: Final = _words(
    "lat latitude latitudine lon lng long longitude longitudine angle bearing azimuth heading theta deg degrees"
)
_CAMERA_IN_TEXT = re.compile(
    r"(?<![a-z])((?:tele)?camera|kamera|cam|sensor|stream|channel|kanal|view)(?!s(?![a-z0-9]))s?[ _=-]*"
    r"((?:cam-?)?(?:\d|\d{2,}(?![.-]\d))|[a-z])(?![a-z0-9])"  # no date: `camera 25.11.2025`, no plural: `cams`
)
_ADDRESS: Final = re.compile(r"(?:rtsps?|rtmp|srt|onvif)://\S+|\d{1,3}(?:\.\d{1,3}){3}(?::\d{1,5})?", re.IGNORECASE)
_BOXES: Final = _words("bbox box boundingbox bndbox rect rectangle bb xyxy xywh tlbr ltrb tlwh ltwh cxcywh")
_SIDES: Final = {
    "corner": _words("right bottom xmax ymax maxx maxy xbr ybr"),
    "size": _words("w h width height breite larghezza altezza"),
}


def is_whole_box(name: str) -> bool:
    """Return whether a column or value of this name holds all sides of a box."""
    return letters(name.rpartition(".")[2]) in _BOXES


def names_degrees(name: str) -> bool:
    """Return whether a column's name says that it holds an angle, such as a latitude."""
    return any(part.lower() in _DEGREES for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name))


def names_motion(name: str) -> bool:
    """Return whether a column's name says that it holds a speed or an acceleration along an axis, such as `vel_x`."""
    return _MOTION.fullmatch(letters(name.rpartition(".")[2])) is not None


def cameras_in(texts: Iterable[str]) -> set[str]:
    """Return the cameras that paths, names of files or topics name: `site/cam2/people` names cam2."""
    return {f"{word}{which}" for text in texts for word, which in _CAMERA_IN_TEXT.findall(text.lower())}


def is_address(text: str) -> bool:
    """Return whether a text is where a camera is in the network: an IPv4 address, or the address of a stream."""
    return _ADDRESS.fullmatch(text.strip()) is not None


def differing_cameras(texts: Iterable[str]) -> frozenset[str]:
    """Return the cameras that some of these texts name, and not all of those that name any."""
    named = [cameras for text in texts if (cameras := cameras_in([text]))]
    return frozenset().union(*named).difference(named[0].intersection(*named) if named else ())


def side_named(name: str) -> str | None:
    """Return "corner" or "size" where a column's name says which of them it holds of a box; None where it does not."""
    last = name.lower().rpartition("_")[2]
    if last in ("x2", "y2"):
        return "corner"
    return next((what for what, names in _SIDES.items() if {last, letters(name)} & names), None)


def of_another_person(name: str, names: Iterable[str]) -> str | None:
    """Return the name that differs from a name in one number only, as `p2_x` does from `p1_x`, or None."""
    shape = re.sub(r"\d+", "0", name)
    alike = [n for n in names if n != name and re.sub(r"\d+", "0", n) == shape]
    mine = re.findall(r"\d+", name)
    return next((n for n in alike if sum(a != b for a, b in zip(re.findall(r"\d+", n), mine, strict=True)) == 1), None)
