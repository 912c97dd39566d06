"""The XML of a URDF: its links and joints, and the tree that they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from armkin.errors import MissingExtraError, RobotFileError, UsageError

MAX_DEPTH = 50
MAX_LINKS = 2_000

Solids = dict[str, list[tuple[str, dict[str, str]]]]  # link -> what its <collision> elements hold: tag, attributes
Visuals = dict[str, list[dict[str, dict[str, str]]]]  # link -> of each <visual>: origin and mesh, their attributes

_SEEN = (["link", "visual"], "origin"), (["link", "visual", "geometry"], "mesh")
_FORMATS = {"sdf": "an SDF file", "mujoco": "a MuJoCo file", "COLLADA": "a mesh", "gazebo": "a Gazebo file"}


@dataclass
class Joint:
    """A <joint> as it stands in the file."""

    name: str
    kind: str
    parts: dict[str, dict[str, str]] = field(default_factory=dict)  # tag -> attributes

    def text(self, tag: str, attribute: str) -> str | None:
        """An attribute of one of the joint's elements, or None."""
        return self.parts.get(tag, {}).get(attribute)


class _Reader:
    """The XML parser's listener: keeps the links' names and the joints, and the depth in bounds."""

    def __init__(self, name: str) -> None:
        self.name, self.depth, self.robot = name, 0, ""
        self.links: dict[str, None] = {}
        self.joints: dict[str, Joint] = {}
        self.joint: Joint | None = None
        self.solids: Solids = {}
        self.visuals: Visuals = {}
        self.open_tags: list[str] = []

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """An element begins."""
        self.depth += 1
        self._check_element(tag)
        if self.depth == 1:
            self.robot = attributes.get("name", "")
        elif self.depth == 2 and tag in ("link", "joint"):
            self._add_named(tag, attributes)
        elif self.depth == 3 and self.joint is not None:
            self.joint.parts.setdefault(tag, dict(attributes))
        elif self.open_tags[1:] == ["link", "collision", "geometry"]:
            self.solids[next(reversed(self.links))].append((tag, dict(attributes)))
        elif self.open_tags[1:] == ["link"] and tag == "visual":
            self.visuals[next(reversed(self.links))].append({})
        elif (self.open_tags[1:], tag) in _SEEN:
            self.visuals[next(reversed(self.links))][-1][tag] = dict(attributes)
        self.open_tags.append(tag)

    def _check_element(self, tag: str) -> None:
        if "xacro" in tag:
            raise is_xacro(self.name)
        if self.depth > MAX_DEPTH:
            raise RobotFileError(f"{self.name}: elements nested deeper than {MAX_DEPTH}; a URDF has about 5")
        if self.depth == 1 and tag != "robot":
            other_format = _FORMATS.get(tag, f"its outermost element is <{tag[:40]}>")
            raise RobotFileError(f"{self.name}: is not a URDF but {other_format}; a URDF begins with <robot name=...>")

    def _add_named(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Note a link or joint by its name, which is unique."""
        name = attributes.get("name")
        if not name:
            raise RobotFileError(f"{self.name}: a <{tag}> has no name")
        items: Mapping[str, object] = self.links if tag == "link" else self.joints
        if name in items:
            raise RobotFileError(f"{self.name}: two {tag}s are named {name}; the names of {tag}s are unique")
        if len(items) >= MAX_LINKS:
            raise RobotFileError(f"{self.name}: more than {MAX_LINKS} {tag}s")
        if tag == "link":
            self.links[name] = None
            self.solids[name], self.visuals[name] = [], []
        else:
            self.joint = self.joints[name] = Joint(name, attributes.get("type", ""))

    def end(self, tag: str) -> None:
        """An element ends."""
        if self.depth == 2:
            self.joint = None
        self.depth -= 1
        self.open_tags.pop()

    def data(self, text: str) -> None:
        """Text between elements means nothing in a URDF."""

    def close(self) -> None:
        """The document has ended."""


def parse_document(raw: bytes, name: str) -> tuple[str, Tree]:
    """The robot's name, and its links and joints."""
    try:
        from defusedxml.common import DefusedXmlException
        from defusedxml.ElementTree import DefusedXMLParser, ParseError
    except ImportError:
        raise MissingExtraError(
            "reading a URDF needs defusedxml: pip install defusedxml (armkin's extra: urdf)"
        ) from None
    reader = _Reader(name)
    parser = DefusedXMLParser(target=reader, forbid_dtd=True)
    if not raw.strip():
        raise RobotFileError(f"{name}: is empty; a URDF begins with <robot name=...>")
    try:
        parser.feed(raw.lstrip())  # some real files begin with an empty line, which XML forbids
        parser.close()
    except DefusedXmlException:
        raise RobotFileError(f"{name}: has a DTD or entities, which no URDF needs; remove <!DOCTYPE ...>") from None
    except (ParseError, ValueError, LookupError) as error:
        if isinstance(error, UsageError):
            raise
        if b"xmlns:xacro" in raw[:10_000] or name.endswith(".xacro"):
            raise is_xacro(name) from None
        raise RobotFileError(f"{name}: is not XML: {error}") from None
    return reader.robot, Tree(name, list(reader.links), list(reader.joints.values()), reader.solids, reader.visuals)


def is_xacro(name: str) -> RobotFileError:
    """The error of a file that is a template of a URDF."""
    return RobotFileError(
        f"{name}: is a xacro, a template of a URDF; make the URDF first:\n"
        "`xacro FILE > arm.urdf` (ROS) or `pip install xacrodoc; xacrodoc FILE -o arm.urdf`"
    )


class Tree:
    """Which link hangs on which, checked: every link has one parent at most, and there is no circle."""

    def __init__(self, name: str, links: list[str], joints: list[Joint], solids: Solids, visuals: Visuals) -> None:
        self.name, self.links = name, links
        self.solids, self.visuals = solids, visuals
        self.parent: dict[str, Joint] = {}  # link -> the joint that it hangs on
        self.children: dict[str, list[Joint]] = {link: [] for link in links}
        for joint in joints:
            self._add_joint(joint)
        for link in links:
            self._check_way_down(link)

    def _add_joint(self, joint: Joint) -> None:
        parent, child = self._link_of_joint(joint, "parent"), self._link_of_joint(joint, "child")
        if child in self.parent:
            first = self.parent[child].name
            raise RobotFileError(
                f"{self.name}: link {child} hangs on two joints, {first} and {joint.name}; a URDF is a tree, "
                "a closed linkage cannot be read"
            )
        self.parent[child] = joint
        self.children[parent].append(joint)

    def _link_of_joint(self, joint: Joint, end: str) -> str:
        """A joint's parent or child."""
        link = joint.text(end, "link")
        if link is None:
            raise RobotFileError(f"{self.name}: joint {joint.name}: has no <{end} link=...>")
        if link not in self.children:
            raise RobotFileError(f"{self.name}: joint {joint.name}: there is no {end} link {link}")
        return link

    def _check_way_down(self, link: str) -> None:
        """From a link to its parent, and on to one that has none."""
        links_above = {link}
        while link in self.parent:
            link = str(self.parent[link].text("parent", "link"))
            if link in links_above:
                raise RobotFileError(
                    f"{self.name}: link {link} hangs on itself by way of others: the joints are a circle"
                )
            links_above.add(link)
            if len(links_above) > 200:
                raise RobotFileError(f"{self.name}: a chain of more than 200 links")

    def base(self, base: str | None) -> str:
        """The link that the chain begins with."""
        if base is not None:
            return self._existing_link(base, "base")
        roots = [link for link in self.links if link not in self.parent and self.children[link]]
        if len(roots) != 1:
            problem = f"several links have no parent: {in_words(roots)}" if roots else "no link carries another"
            if not roots:
                raise RobotFileError(f"{self.name}: {problem}; there is no chain")
            raise UsageError(f"{self.name}: {problem}; the base must be named")
        return roots[0]

    def tip(self, base: str, tip: str | None) -> str:
        """The link that the chain ends with: the only leaf that moves, or the one asked for."""
        if tip is not None:
            link = self._existing_link(tip, "tip")
            while link != base and link in self.parent:
                link = str(self.parent[link].text("parent", "link"))
            if link != base:
                raise UsageError(f"{self.name}: tip {tip} does not hang on base {base}")
            return tip
        leaves = [(self.count_moving(base, link), link) for link in self.leaves(base)]
        moving_leaves = [link for count, link in leaves if count]
        if not moving_leaves:
            raise RobotFileError(f"{self.name}: no joint moves between {base} and its ends; there is no arm")
        if len(moving_leaves) > 1:
            candidates = list(dict.fromkeys([*self._shared_body(base, moving_leaves), *moving_leaves]))
            raise UsageError(
                f"{self.name}: the arm has several ends, and which is its tip is not said; "
                f"the tip must be named: {in_words(candidates)}"
            )
        return moving_leaves[0]

    def leaves(self, base: str) -> list[str]:
        """Links below base that carry none."""
        leaves, stack = [], [base]
        while stack:
            link = stack.pop()
            below = [str(joint.text("child", "link")) for joint in self.children[link]]
            stack += below
            if not below:
                leaves.append(link)
        return sorted(leaves, key=self.links.index)

    def count_moving(self, base: str, link: str) -> int:
        """How many moving joints lie between base and a link."""
        return sum(joint.kind != "fixed" for joint in self.chain(base, link))

    def _shared_body(self, base: str, links: list[str]) -> list[str]:
        """The links of the last moving body that all these links hang on; [] if that is the base."""
        chains = [self.chain(base, link) for link in links]
        common = [joint for joint in chains[0] if all(joint in chain for chain in chains) and joint.kind != "fixed"]
        body = [str(joint.text("child", "link")) for joint in common[-1:]]
        for link in body:
            body += [str(joint.text("child", "link")) for joint in self.children[link] if joint.kind == "fixed"]
        return body

    def chain(self, base: str, tip: str) -> list[Joint]:
        """The joints from base to tip."""
        joints: list[Joint] = []
        while tip != base:
            joints.append(self.parent[tip])
            tip = str(joints[-1].text("parent", "link"))
        return joints[::-1]

    def collision_shapes(self, link: str) -> list[tuple[str, dict[str, str]]]:
        """The collision shapes of a link and of all that is fixed to it."""
        shapes, stack = [], [link]
        while stack:
            link = stack.pop()
            shapes += self.solids[link]
            stack += [str(joint.text("child", "link")) for joint in self.children[link] if joint.kind == "fixed"]
        return shapes

    def _existing_link(self, link: str, role: str) -> str:
        if link not in self.children:
            raise UsageError(
                f"{self.name}: there is no link {link} for the {role}; the links are {in_words(self.links)}"
            )
        return link


def in_words(names: list[str]) -> str:
    """Names in a sentence, the first twelve of them."""
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
