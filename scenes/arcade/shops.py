"""Rooms behind the windows, and what is in them."""

from __future__ import annotations

from scenes.arcade import furniture as f
from scenes.arcade import glassware as g
from scenes.arcade.display import Display
from scenes.arcade.plan import BAY, FRONTS, HEAD, SHOP_DEPTH, SHOP_HEIGHT, Front, front_named
from scenes.modeling.geometry import Patch, join, polygon, pose

_HALF_SHOP, _FACE = BAY / 2 - 0.03, 0.04  # half a shop's width; inner face of the front


def furnish_shops(show: Display) -> None:
    """All shops, from the street on."""
    for front in FRONTS:
        if front.wall:
            _room(show, front)
    _cafe(show)
    _books(show)
    _glass(show)
    _toys(show)
    _hats(show)
    _flora(show)
    _optics(show)
    _tailor(show)
    _clinic(show)
    _discs(show)


def _room(show: Display, front: Front) -> None:
    """Floor, ceiling, walls and lamps."""
    w, deep, high = _HALF_SHOP, SHOP_DEPTH, SHOP_HEIGHT
    name, at = front.name, front.place()
    floor = polygon([(-w, 0, 0), (w, 0, 0), (w, deep, 0), (-w, deep, 0)])
    is_wood = front.lamp == "lamp_warm"
    show.lay(f"floor_{name}", "oak_floor" if is_wood else "checker_floor", floor, at)
    ceiling = polygon([(-w, 0, high), (-w, deep, high), (w, deep, high), (w, 0, high)])
    show.lay(f"ceiling_{name}", "plaster", ceiling, at)
    walls = [
        polygon([(-w, deep, 0), (w, deep, 0), (w, deep, high), (-w, deep, high)]),
        polygon([(-w, 0, 0), (-w, deep, 0), (-w, deep, high), (-w, 0, high)]),
        polygon([(w, deep, 0), (w, 0, 0), (w, 0, high), (w, deep, high)]),
        *_behind_front(front),
    ]
    show.lay(f"wall_{name}", front.wall, join(walls), at)
    for y in (0.95, 2.25):
        place = front.place(0.0, y, high)
        show.put("lamp", show.made(f.lamp_panel, front.lamp), place)
        show.put("lamp_housing", show.made(f.lamp_housing), place)


def _behind_front(front: Front) -> list[Patch]:
    """Inner faces above the window and beside it."""
    w, half, high = _HALF_SHOP, BAY / 2 - 0.25, SHOP_HEIGHT
    spans = ((-w, w, HEAD, high), (-w, -half, 0.0, HEAD), (half, w, 0.0, HEAD))
    return [
        polygon([(x1, _FACE, z0), (x0, _FACE, z0), (x0, _FACE, z1), (x1, _FACE, z1)])
        for x0, x1, z0, z1 in spans
    ]


def _wall_shelves(show: Display, front: Front, goods: str, count: int = 3) -> None:
    """Shelves at the back wall."""
    for k in range(count):
        at = front.place(1.55 * (k - (count - 1) / 2), SHOP_DEPTH - 0.01)
        show.put(f"shelf_{front.name}", show.made(f.shelf, goods, k % 2), at)


def _window_middle(front: Front) -> float:
    """Middle of the window beside the door."""
    return -0.5 * front.door * 1.07


def _cafe(show: Display) -> None:
    front = front_named("cafe")
    show.put("counter", show.made(f.counter, "wine"), front.place(1.0, 2.35))
    _wall_shelves(show, front, "none", 2)
    colors = ("crystal", "bottle_green", "amber_glass", "cobalt", "bottle_green", "ruby")
    for row, z in enumerate((0.506, 0.916, 1.326, 1.736)):
        for k, x in enumerate((-1.25, -1.0, -0.55, -0.3, 0.35, 0.6, 1.0, 1.25)):
            if (3 * row + 2 * k) % 5 < 3:
                continue
            glass = colors[(k + 2 * row) % len(colors)]
            place = front.place(x, SHOP_DEPTH - 0.2, z)
            show.put("bottle", show.made(g.bottle, glass), place)
    for x, y in ((1.35, 0.75), (0.1, 0.8)):
        show.put("table", show.made(f.round_table), front.place(x, y))
        show.put("cup", show.made(f.cup), front.place(x + 0.1, y - 0.08, 0.73))
        show.put("vase", show.made(g.bottle, "crystal"), front.place(x - 0.1, y + 0.06, 0.73))
        show.put("chair", show.made(f.chair, "wine"), front.place(x + 0.5, y + 0.15, 0, -80))
        show.put("chair", show.made(f.chair, "wine"), front.place(x - 0.48, y + 0.1, 0, 95))
    show.put("a_board", show.made(f.a_board), front.place(0.3, -0.55, 0, 12))


def _books(show: Display) -> None:
    front = front_named("books")
    _wall_shelves(show, front, "books")
    for x, yaw in ((-_HALF_SHOP + 0.01, 90), (_HALF_SHOP - 0.01, -90)):
        place = front.place(x, 1.9, 0, yaw)
        show.put("shelf_books", show.made(f.shelf, "books", 1), place)
    middle = _window_middle(front)
    show.put("stage", show.made(f.stage, "joinery"), front.place(middle, 0.55))
    for k in range(5):
        picture = show.made(f.wall_picture, ("poster_sphere", "poster_waves")[k % 2], 260, 360)
        place = front.place(middle - 1.1 + 0.55 * k, 0.55, 0.45, 5 * (k - 2))
        show.put("book", picture, place)
    show.put("counter", show.made(f.counter, "moss"), front.place(0.2, 1.9))


def _glass(show: Display) -> None:
    front = front_named("glass")
    middle = _window_middle(front)
    show.put("stage", show.made(f.stage, "white"), front.place(middle, 0.55))
    show.put("stand", show.made(f.glass_shelf_stand), front.place(middle, 0.55, 0.45))
    hues = ("crystal", "cobalt", "ruby", "amber_glass", "bottle_green")
    for row, z in enumerate((0.46, 0.91, 1.36)):
        for k in range(5):
            x = middle - 1.05 + 0.5 * k + 0.06 * row
            makers = (g.vase, g.bowl, g.bottle)
            maker = makers[(k + row) % 3] if row < 2 else makers[(k + 1) % 3]
            model = show.made(maker, hues[(k + 2 * row) % 5])
            show.put("glassware", model, front.place(x, 0.55, z))
    for k, hue in enumerate(("crystal", "cobalt", "ruby")):
        x = -1.4 + 1.4 * k
        show.put("plinth", show.made(f.plinth, "white", 360, 900), front.place(x, 2.2))
        show.put("glassware", show.made(g.vase, hue), front.place(x, 2.2, 0.9))
    _wall_shelves(show, front, "none", 2)


def _toys(show: Display) -> None:
    front = front_named("toys")
    middle = _window_middle(front)
    _wall_shelves(show, front, "boxes")
    show.put("stage", show.made(f.stage, "red"), front.place(middle, 0.55))
    goods = (
        show.made(f.toy_ball, "red"),
        show.made(f.toy_robot),
        show.made(f.toy_tower),
        show.made(f.toy_ball, "mustard"),
        show.made(f.toy_robot),
    )
    for k, model in enumerate(goods):
        show.put("toy", model, front.place(middle - 1.15 + 0.56 * k, 0.5, 0.45, 14 * k - 28))
    place = front.place(middle + 0.28, 0.78, 0.56) @ pose(scale=0.11)
    show.put("chrome_ball", show.made(g.chrome_ball), place)
    show.put("counter", show.made(f.counter, "teal"), front.place(0.3, 2.0))


def _hats(show: Display) -> None:
    front = front_named("hats")
    middle = _window_middle(front)
    _wall_shelves(show, front, "boxes", 2)
    show.put("stage", show.made(f.stage, "wine"), front.place(middle, 0.55))
    for k, cloth in enumerate(("navy", "red", "ivory", "mustard", "moss")):
        show.put("hat", show.made(f.hat, cloth), front.place(middle - 1.1 + 0.55 * k, 0.5, 0.45))
    show.put("counter", show.made(f.counter, "leather"), front.place(0.2, 1.9))
    for k, cloth in enumerate(("navy", "ivory")):
        show.put("hat", show.made(f.hat, cloth), front.place(-0.4 + 0.5 * k, 1.9, 0.97))


def _flora(show: Display) -> None:
    front = front_named("flora")
    middle = _window_middle(front)
    for k in range(4):
        place = front.place(middle - 1.0 + 0.66 * k, 0.5, 0, 40 * k)
        show.put("bouquet", show.made(f.bouquet, k % 2), place)
    for k, (x, y, high) in enumerate(((-1.7, 2.4, 1400), (0.0, 2.6, 1100), (1.6, 2.3, 1400))):
        show.plant(high, front.place(x, y, 0, 100 * k))
    show.put("counter", show.made(f.counter, "moss"), front.place(0.3, 1.5))
    show.put("vase", show.made(g.vase, "bottle_green"), front.place(-0.2, 1.5, 0.97))
    for x, y in ((middle - 0.9, -0.32), (middle + 0.9, -0.32)):
        show.put("bouquet", show.made(f.bouquet, 1), front.place(x, y, 0, 60 * x))


def _optics(show: Display) -> None:
    front = front_named("optics")
    middle = _window_middle(front)
    show.put("stage", show.made(f.stage, "navy"), front.place(middle, 0.55))
    lens = show.made(g.lens, "crystal")
    for k in range(3):
        place = front.place(middle - 0.9 + 0.9 * k, 0.5, 0.65, 12 * (k - 1))
        show.put("lens", lens, place)
    for k, radius in enumerate((0.10, 0.07)):
        place = front.place(middle - 0.45 + 0.9 * k, 0.6, 0.45 + radius) @ pose(scale=radius)
        if k:
            show.put("chrome_ball", show.made(g.chrome_ball), place)
        else:
            show.put("glass_ball", show.made(g.glass_ball, "crystal"), place)
    _wall_shelves(show, front, "boxes", 2)
    chart = show.made(f.wall_picture, "eye_chart", 500, 780)
    show.put("picture", chart, front.place(-_HALF_SHOP + 0.03, 1.6, 1.0, 90))
    show.put("counter", show.made(f.counter, "navy"), front.place(0.2, 1.9))
    show.put("chair", show.made(f.chair, "navy"), front.place(-1.4, 1.6, 0, 100))


def _tailor(show: Display) -> None:
    front = front_named("tailor")
    middle = _window_middle(front)
    for k, cloth in enumerate(("navy", "leather", "wine")):
        place = front.place(middle - 0.9 + 0.9 * k, 0.6, 0, 20 * (k - 1))
        show.put("mannequin", show.made(f.mannequin, cloth), place)
    _wall_shelves(show, front, "boxes", 2)
    show.put("counter", show.made(f.counter, "leather"), front.place(0.0, 2.0))
    glass = polygon([(-0.4, 0, 0.15), (0.4, 0, 0.15), (0.4, 0, 2.05), (-0.4, 0, 2.05)])
    side = -front.door * (_HALF_SHOP - 0.02)
    show.lay("mirror_fitting", "mirror", glass, front.place(side, 1.7, 0, 90 * front.door))


def _clinic(show: Display) -> None:
    front = front_named("clinic")
    for x in (-1.2, -0.5, 0.2):
        show.put("chair", show.made(f.chair, "teal"), front.place(x, 2.6))
    show.plant(1100, front.place(-1.9, 0.7))
    show.put("counter", show.made(f.counter, "white"), front.place(0.0, 1.3))
    waves = show.made(f.wall_picture, "poster_waves", 800, 1100)
    show.put("picture", waves, front.place(0.6, SHOP_DEPTH - 0.002, 1.0))


def _discs(show: Display) -> None:
    front = front_named("discs")
    middle = _window_middle(front)
    _wall_shelves(show, front, "discs")
    show.put("stage", show.made(f.stage, "lacquer"), front.place(middle, 0.55))
    for k in range(3):
        cover = show.made(f.wall_picture, "covers", 800, 400)
        place = front.place(middle - 0.95 + 0.95 * k, 0.6, 0.45, 6 * (k - 1))
        show.put("disc_cover", cover, place)
    for x in (-1.0, 0.9):
        show.put("plinth", show.made(f.plinth, "navy", 700, 800), front.place(x, 1.9))
