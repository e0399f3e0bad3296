"""The Vulkan registry: the system's vk.xml, and behind it newer_registry.xml for what that one does not know yet."""
import os
import xml.etree.ElementTree as ET

NEWER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "newer_registry.xml")


def name_of(element):
    """Of a type, a command or an extension."""
    for path in ("name", "proto/name"):
        if element.find(path) is not None:
            return element.find(path).text
    return element.get("name")


def newer():
    """The root of the supplement alone."""
    return ET.parse(NEWER).getroot()


def load(vk_xml):
    """The root of the system's registry, with the supplement's types, commands and extensions that are not in it."""
    root = ET.parse(vk_xml).getroot()
    for section in newer():
        there = root.find(section.tag)
        if there is None or section.tag == "comment":
            continue
        known = {name_of(e) for e in there}
        there.extend(e for e in section if name_of(e) not in known)
    return root
