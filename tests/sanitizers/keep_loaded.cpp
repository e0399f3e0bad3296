// Linked into every test program of a sanitizer build: libraries stay loaded until the process ends.
//
// The Vulkan loader unloads a driver with its last instance. Reports about code that is gone have no symbols,
// so neither people nor suppressions could tell a leak of ours from one of another driver.
extern "C" [[gnu::visibility("default")]] int dlclose(void*) { return 0; }
