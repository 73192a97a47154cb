"""The instrument as URDF text: cylinders and spheres alone, so that viewers fetch nothing."""

import math
import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element, SubElement

from endoscope_core.kinematics.constant_curvature import VERTEBRAE, Vertebrae

_RADIUS = 0.15
_TUBE = 2.0
_TIP = 0.16
# At full reach the wire on the outside would show gaps between two vertebrae.
_OVERLAP = 0.2
_COLOURS = {
    'tube': '0.30 0.34 0.40 1',
    'sheath': '0.20 0.23 0.27 1',
    'vertebra': '0.80 0.83 0.87 1',
    'tip': '0.95 0.96 0.97 1',
    'lens': '0.05 0.35 0.55 1',
    'wires_x': '0.18 0.62 0.78 1',
    'wires_y': '0.71 0.55 1.00 1',
}


def robot_description(section: Vertebrae) -> str:
    """Describe insertion tube, bending section with its wires, and tip as URDF; lengths in m.

    Everything but the bending section is as large as looks right beside that.
    """
    robot = Element('robot', name='endoscope')
    for name, rgba in _COLOURS.items():
        SubElement(SubElement(robot, 'material', name=name), 'color', rgba=rgba)
    _base(SubElement(robot, 'link', name=section.base_frame), section)
    for hinge in section.hinges:
        link = SubElement(robot, 'link', name=hinge.child)
        if hinge.child == section.tip_frame:
            _tip(link, section)
        elif not hinge.child.endswith('_hinge'):
            _vertebra(link, section, last=hinge.child.endswith(f'_{VERTEBRAE:02}'))
        joint = SubElement(
            robot, 'joint', name=hinge.name, type='revolute' if hinge.axis else 'fixed'
        )
        SubElement(joint, 'parent', link=hinge.parent)
        SubElement(joint, 'child', link=hinge.child)
        SubElement(joint, 'origin', xyz=_numbers(0.0, 0.0, hinge.height), rpy='0 0 0')
        if hinge.axis:
            SubElement(joint, 'axis', xyz='1 0 0' if hinge.axis == 'x' else '0 1 0')
            most = f'{math.pi / VERTEBRAE:.6g}'
            SubElement(joint, 'limit', lower=f'-{most}', upper=most, effort='0', velocity='0')
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding='unicode', xml_declaration=True)


def _base(link: Element, section: Vertebrae) -> None:
    radius, tube = _RADIUS * section.length, _TUBE * section.length
    _cylinder(link, 'tube', radius, tube, (0.0, 0.0, -0.5 * tube))
    _cylinder(link, 'sheath', 0.9 * radius, section.spacing, (0.0, 0.0, 0.0))
    _wires(link, section, 0.0, 0.5 * section.spacing)


def _vertebra(link: Element, section: Vertebrae, last: bool) -> None:
    radius = _RADIUS * section.length
    space = section.spacing * (0.5 if last else 1.0)
    _sphere(link, 'sheath', 0.9 * radius, (0.0, 0.0, 0.0))
    _cylinder(link, 'sheath', 0.9 * radius, space, (0.0, 0.0, 0.5 * space))
    if not last:
        _cylinder(link, 'vertebra', radius, 0.5 * space, (0.0, 0.0, 0.5 * space))
    overlap = _OVERLAP * section.spacing
    _wires(link, section, -overlap, space + overlap)


def _tip(link: Element, section: Vertebrae) -> None:
    radius, length = _RADIUS * section.length, _TIP * section.length
    _cylinder(link, 'tip', radius, length, (0.0, 0.0, 0.5 * length))
    _cylinder(link, 'lens', 0.45 * radius, 0.1 * length, (0.0, 0.0, 1.01 * length))


def _wires(link: Element, section: Vertebrae, start: float, stop: float) -> None:
    """Draw the four wires along the outside, where their names show whose tension is drawn."""
    away = 1.02 * _RADIUS * section.length
    middle = 0.5 * (start + stop)
    for material, x, y in (
        ('wires_x', away, 0.0),
        ('wires_x', -away, 0.0),
        ('wires_y', 0.0, away),
        ('wires_y', 0.0, -away),
    ):
        _cylinder(link, material, 0.09 * away, stop - start, (x, y, middle))


def _cylinder(
    link: Element, material: str, radius: float, length: float, centre: tuple[float, float, float]
) -> None:
    geometry = _visual(link, material, centre)
    SubElement(geometry, 'cylinder', radius=f'{radius:.6g}', length=f'{length:.6g}')


def _sphere(
    link: Element, material: str, radius: float, centre: tuple[float, float, float]
) -> None:
    SubElement(_visual(link, material, centre), 'sphere', radius=f'{radius:.6g}')


def _visual(link: Element, material: str, centre: tuple[float, float, float]) -> Element:
    visual = SubElement(link, 'visual')
    SubElement(visual, 'origin', xyz=_numbers(*centre), rpy='0 0 0')
    geometry = SubElement(visual, 'geometry')
    SubElement(visual, 'material', name=material)
    return geometry


def _numbers(*values: float) -> str:
    return ' '.join(f'{value:.6g}' for value in values)
