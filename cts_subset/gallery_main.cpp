// pumice_gallery: renders every scene of the gallery on a device and writes PNG files.
#include "cts_subset/harness/oracle.h"

#include <chrono>
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
         "       pumice_gallery --errors FILE [--scene NAME]...\n"
         "  --errors FILE  how far each scene is from its picture in double, as a table (Pumice only)\n"
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

// A line of the table of errors.
void writeErrors(std::ostream& out, Device& device, const Scene& scene) {
  scene.render(device, Variant::kGood);  // what is made once is made
  const auto start = std::chrono::steady_clock::now();
  const Picture picture = scene.render(device, Variant::kGood);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const OracleRun oracle = renderRecorded(device, scene, true), recorded = renderRecorded(device, scene, false);
  const OracleError e = oracleError(picture, oracle.picture, recorded.passes, oracle.passes, 1);
  char line[256];
  std::snprintf(line, sizeof line, "| %s | %.1f | %.1f | %llu | %llu | %.3f %% | %d | %.5f | %llu |\n", scene.name.c_str(), seconds * 1e3, oracle.seconds * 1e3,
                static_cast<unsigned long long>(e.mismatches), static_cast<unsigned long long>(e.elsewhere), 100.0 * double(e.unequal) / double(e.pixels),
                e.largest, e.mean, static_cast<unsigned long long>(e.colourBeyond));
  out << line;
}

constexpr const char* kErrorsHead =
    "# What rounding costs\n\n"
    "Every scene of the gallery as usual (f32) against the same scene in double precision (`PUMICE_NUMERICS=reference`), made by\n"
    "`./dev report`. *Decided otherwise* are pixels where a discrete decision came out differently: which primitive covers a sample,\n"
    "a branch, a texel, a level, a whole number (`PUMICE_DECISIONS`); *elsewhere* the same in passes of another size, like shadow maps.\n"
    "Errors of colours are those of all other pixels, in 1/255. Run times (of this machine, as busy as it was) include the making of\n"
    "pipelines and the reading back of the picture.\n\n"
    "| scene | f32, ms | double, ms | decided otherwise | elsewhere | unequal pixels | largest error | mean error | beyond 1 |\n"
    "|---|---|---|---|---|---|---|---|---|\n";

}  // namespace

int main(int argc, char** argv) try {
  std::string out, errors, wanted = testedDeviceName();
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
    else if (word == "--errors")
      errors = argv[++i];
    else if (word == "--device")
      wanted = argv[++i];
    else if (word == "--scene")
      only.push_back(argv[++i]);
    else
      return usage(2);
  }
  if (out.empty() == errors.empty()) return usage(2);
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
  if (!errors.empty()) {
    std::ofstream table(errors);
    table << kErrorsHead;
    for (const Scene& scene : allScenes()) {
      if (!scene.supported(device) || (!only.empty() && std::find(only.begin(), only.end(), scene.name) == only.end())) continue;
      writeErrors(table, device, scene);
    }
    table.close();
    return table.good() ? 0 : 1;
  }
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
