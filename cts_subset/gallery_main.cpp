// pumice_gallery: renders every scene of the gallery on a device and writes PNG files.
#include "cts_subset/harness/scene.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

using namespace pumice::cts;

namespace {

int usage(int status) {
  std::ostream& out = status == 0 ? std::cout : std::cerr;
  out << "usage: pumice_gallery --out DIR [--device NAME] [--scene NAME]... [--list]\n"
         "  --out DIR      where the PNG files go\n"
         "  --device NAME  start of the device's name (default: Pumice)\n"
         "  --scene NAME   only this scene; may be given several times\n"
         "  --list         the names of the scenes\n";
  return status;
}

// FNV-1a over the pixels.
uint64_t hashOf(const Picture& picture) {
  uint64_t hash = 14695981039346656037ull;
  for (uint8_t byte : picture.rgba) hash = (hash ^ byte) * 1099511628211ull;
  return hash;
}

}  // namespace

int main(int argc, char** argv) try {
  std::string out, wanted = testedDeviceName();
  std::vector<std::string> only;
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    if (word == "--help" || word == "-h") return usage(0);
    if (word == "--list") {
      for (const Scene& scene : allScenes()) std::cout << scene.name << "\n";
      return 0;
    }
    if (i + 1 >= argc) return usage(2);
    if (word == "--out")
      out = argv[++i];
    else if (word == "--device")
      wanted = argv[++i];
    else if (word == "--scene")
      only.push_back(argv[++i]);
    else
      return usage(2);
  }
  if (out.empty()) return usage(2);
  for (const std::string& name : only) {
    bool known = false;
    for (const Scene& scene : allScenes()) known = known || scene.name == name;
    if (!known) {
      std::cerr << "pumice_gallery: there is no scene '" << name << "' (see --list)\n";
      return 2;
    }
  }

  selectDrivers();
  VulkanInstance instance(validationRequested());
  VkPhysicalDevice physical = instance.find(wanted);
  if (!physical) {
    std::cerr << "pumice_gallery: no Vulkan device whose name starts with '" << wanted << "'. There are:";
    for (const std::string& name : instance.deviceNames()) std::cerr << " '" << name << "'";
    std::cerr << "\n";
    return 1;
  }
  Device device(physical);
  std::cout << "device: " << device.name() << "\n";
  std::filesystem::create_directories(out);

  std::vector<Picture> pictures;
  std::vector<std::string> names;
  std::ofstream hashes(out + "/hashes.txt");
  int failed = 0;
  for (const Scene& scene : allScenes()) {
    if (!only.empty() && std::find(only.begin(), only.end(), scene.name) == only.end()) continue;
    if (!scene.supported(device)) {
      std::cout << "not supported by this device: " << scene.name << "\n";
      continue;
    }
    try {
      Picture picture = scene.render(device, Variant::kGood);
      std::string path = out + "/" + scene.name + ".png";
      writePng(path, picture);
      std::cout << path << "\n";
      hashes << scene.name << " " << std::hex << hashOf(picture) << std::dec << "\n";
      pictures.push_back(std::move(picture));
      names.push_back(scene.name);
    } catch (const std::exception& error) {
      std::cout << "failed: " << scene.name << ": " << error.what() << "\n";
      ++failed;
    }
  }
  if (!pictures.empty() && only.empty()) {
    writePng(out + "/contact_sheet.png", contactSheet(pictures, names, 9, 160));
    std::cout << out << "/contact_sheet.png\n";
  }
  for (const std::string& message : instance.takeMessages()) std::cout << message << "\n";
  return failed ? 1 : 0;
} catch (const std::exception& error) {
  std::cerr << "pumice_gallery: " << error.what() << "\n";
  return 1;
}
