// Surfaces of every window system: made, destroyed, and asked what they support.
#include <X11/Xlib-xcb.h>

#include <algorithm>

#include "entrypoints.h"
#include "icd/device.h"
#include "icd/wsi/window_system.h"
#include "texture/format.h"

#undef None
#undef Bool
#undef Status
#undef Success
#undef Always

namespace pumice::icd {
namespace {

const VkIcdSurfaceBase& base(VkSurfaceKHR surface) {
  return *reinterpret_cast<const VkIcdSurfaceBase*>(surface);
}

// The structures are the loader's own (vk_icd.h), so surfaces made by either side look the same.
template <typename Surface, typename Fill>
VkResult create(VkInstance handle, const VkAllocationCallbacks* callbacks, VkIcdWsiPlatform platform,
                VkSurfaceKHR* out, Fill&& fill) {
  auto* s = makeObject<Surface>(from(handle)->allocator.orElse(callbacks), VK_SYSTEM_ALLOCATION_SCOPE_OBJECT);
  if (!s) return VK_ERROR_OUT_OF_HOST_MEMORY;
  *s = {};
  s->base.platform = platform;
  fill(*s);
  *out = reinterpret_cast<VkSurfaceKHR>(s);
  return VK_SUCCESS;
}

constexpr VkSurfaceFormatKHR kFormats[] = {
    {VK_FORMAT_B8G8R8A8_UNORM, VK_COLOR_SPACE_SRGB_NONLINEAR_KHR},
    {VK_FORMAT_B8G8R8A8_SRGB, VK_COLOR_SPACE_SRGB_NONLINEAR_KHR},
    {VK_FORMAT_R8G8B8A8_UNORM, VK_COLOR_SPACE_SRGB_NONLINEAR_KHR},
    {VK_FORMAT_R8G8B8A8_SRGB, VK_COLOR_SPACE_SRGB_NONLINEAR_KHR},
};
constexpr VkPresentModeKHR kPresentModes[] = {VK_PRESENT_MODE_IMMEDIATE_KHR, VK_PRESENT_MODE_MAILBOX_KHR,
                                              VK_PRESENT_MODE_FIFO_KHR};

VkResult capabilities(VkPhysicalDevice handle, VkSurfaceKHR surface, VkSurfaceCapabilitiesKHR& out) {
  WindowState state = queryWindow(base(surface));
  if (!state.alive) return VK_ERROR_SURFACE_LOST_KHR;
  uint32_t edge = from(handle)->properties.limits.maxImageDimension2D;
  bool decided = state.extent.width != ~0u;  // the window's size is the swapchain's
  out.minImageCount = 2;
  out.maxImageCount = 0;
  out.currentExtent = state.extent;
  out.minImageExtent = decided ? state.extent : VkExtent2D{1, 1};
  out.maxImageExtent = decided ? state.extent : VkExtent2D{edge, edge};
  out.maxImageArrayLayers = 1;
  out.supportedTransforms = out.currentTransform = VK_SURFACE_TRANSFORM_IDENTITY_BIT_KHR;
  out.supportedCompositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR | VK_COMPOSITE_ALPHA_INHERIT_BIT_KHR;
  if (state.translucent) out.supportedCompositeAlpha |= VK_COMPOSITE_ALPHA_PRE_MULTIPLIED_BIT_KHR;
  out.supportedUsageFlags = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT |
                            VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT |
                            VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT;
  // Of the formats without sRGB; an application asks for its format's own features too.
  if (texture::optimalFeatures(*texture::formatInfo(kFormats[0].format)) &
      VK_FORMAT_FEATURE_2_STORAGE_IMAGE_BIT)
    out.supportedUsageFlags |= VK_IMAGE_USAGE_STORAGE_BIT;
  return VK_SUCCESS;
}

}  // namespace

WindowState queryWindow(const VkIcdSurfaceBase& surface) {
  switch (surface.platform) {
    case VK_ICD_WSI_PLATFORM_XCB: {
      auto& s = reinterpret_cast<const VkIcdSurfaceXcb&>(surface);
      return queryXcbWindow(s.connection, s.window);
    }
    case VK_ICD_WSI_PLATFORM_XLIB: {
      auto& s = reinterpret_cast<const VkIcdSurfaceXlib&>(surface);
      return queryXcbWindow(XGetXCBConnection(s.dpy), xcb_window_t(s.window));
    }
    case VK_ICD_WSI_PLATFORM_WAYLAND:
      return queryWaylandWindow(reinterpret_cast<const VkIcdSurfaceWayland&>(surface).display);
    default:
      return {};
  }
}

std::unique_ptr<Window> openWindow(const VkIcdSurfaceBase& surface, const VkSwapchainCreateInfoKHR& info) {
  switch (surface.platform) {
    case VK_ICD_WSI_PLATFORM_XCB: {
      auto& s = reinterpret_cast<const VkIcdSurfaceXcb&>(surface);
      return openXcbWindow(s.connection, s.window, info.compositeAlpha);
    }
    case VK_ICD_WSI_PLATFORM_XLIB: {
      auto& s = reinterpret_cast<const VkIcdSurfaceXlib&>(surface);
      return openXcbWindow(XGetXCBConnection(s.dpy), xcb_window_t(s.window), info.compositeAlpha);
    }
    case VK_ICD_WSI_PLATFORM_WAYLAND: {
      auto& s = reinterpret_cast<const VkIcdSurfaceWayland&>(surface);
      return openWaylandWindow(s.display, s.surface, info.presentMode, info.compositeAlpha);
    }
    default:
      return nullptr;  // headless: nothing is shown
  }
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateXcbSurfaceKHR(VkInstance instance,
                                                     const VkXcbSurfaceCreateInfoKHR* info,
                                                     const VkAllocationCallbacks* callbacks,
                                                     VkSurfaceKHR* out) {
  return create<VkIcdSurfaceXcb>(instance, callbacks, VK_ICD_WSI_PLATFORM_XCB, out, [&](VkIcdSurfaceXcb& s) {
    s.connection = info->connection;
    s.window = info->window;
  });
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateXlibSurfaceKHR(VkInstance instance,
                                                      const VkXlibSurfaceCreateInfoKHR* info,
                                                      const VkAllocationCallbacks* callbacks,
                                                      VkSurfaceKHR* out) {
  return create<VkIcdSurfaceXlib>(instance, callbacks, VK_ICD_WSI_PLATFORM_XLIB, out,
                                  [&](VkIcdSurfaceXlib& s) {
                                    s.dpy = info->dpy;
                                    s.window = info->window;
                                  });
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateWaylandSurfaceKHR(VkInstance instance,
                                                         const VkWaylandSurfaceCreateInfoKHR* info,
                                                         const VkAllocationCallbacks* callbacks,
                                                         VkSurfaceKHR* out) {
  return create<VkIcdSurfaceWayland>(instance, callbacks, VK_ICD_WSI_PLATFORM_WAYLAND, out,
                                     [&](VkIcdSurfaceWayland& s) {
                                       s.display = info->display;
                                       s.surface = info->surface;
                                     });
}

VKAPI_ATTR VkResult VKAPI_CALL vkCreateHeadlessSurfaceEXT(VkInstance instance,
                                                          const VkHeadlessSurfaceCreateInfoEXT*,
                                                          const VkAllocationCallbacks* callbacks,
                                                          VkSurfaceKHR* out) {
  return create<VkIcdSurfaceHeadless>(instance, callbacks, VK_ICD_WSI_PLATFORM_HEADLESS, out,
                                      [](VkIcdSurfaceHeadless&) {});
}

VKAPI_ATTR void VKAPI_CALL vkDestroySurfaceKHR(VkInstance instance, VkSurfaceKHR surface,
                                               const VkAllocationCallbacks* callbacks) {
  // Plain structures all: no destructor to run.
  from(instance)->allocator.orElse(callbacks).free(reinterpret_cast<void*>(surface));
}

VKAPI_ATTR VkBool32 VKAPI_CALL vkGetPhysicalDeviceXcbPresentationSupportKHR(VkPhysicalDevice, uint32_t,
                                                                            xcb_connection_t* connection,
                                                                            xcb_visualid_t visual) {
  return xcbVisualPresentable(connection, visual);
}
VKAPI_ATTR VkBool32 VKAPI_CALL vkGetPhysicalDeviceXlibPresentationSupportKHR(VkPhysicalDevice, uint32_t,
                                                                             Display* display,
                                                                             VisualID visual) {
  return xcbVisualPresentable(XGetXCBConnection(display), xcb_visualid_t(visual));
}
VKAPI_ATTR VkBool32 VKAPI_CALL vkGetPhysicalDeviceWaylandPresentationSupportKHR(VkPhysicalDevice, uint32_t,
                                                                                wl_display*) {
  return VK_TRUE;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceSurfaceSupportKHR(VkPhysicalDevice, uint32_t,
                                                                    VkSurfaceKHR surface, VkBool32* out) {
  WindowState state = queryWindow(base(surface));
  *out = state.alive && state.presentable;
  return state.alive ? VK_SUCCESS : VK_ERROR_SURFACE_LOST_KHR;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceSurfaceCapabilitiesKHR(VkPhysicalDevice device,
                                                                         VkSurfaceKHR surface,
                                                                         VkSurfaceCapabilitiesKHR* out) {
  return capabilities(device, surface, *out);
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceSurfaceCapabilities2KHR(
    VkPhysicalDevice device, const VkPhysicalDeviceSurfaceInfo2KHR* info, VkSurfaceCapabilities2KHR* out) {
  auto* asked = findInChain<VkSurfacePresentModeEXT>(info->pNext, VK_STRUCTURE_TYPE_SURFACE_PRESENT_MODE_EXT);
  for (auto* s = static_cast<VkBaseOutStructure*>(out->pNext); s; s = s->pNext) switch (s->sType) {
      case VK_STRUCTURE_TYPE_SURFACE_PRESENT_SCALING_CAPABILITIES_EXT: {
        // Pictures of another size are shown as far as they fit; nothing is scaled on demand.
        auto& scaling = *reinterpret_cast<VkSurfacePresentScalingCapabilitiesEXT*>(s);
        scaling.supportedPresentScaling = scaling.supportedPresentGravityX = scaling.supportedPresentGravityY = 0;
        scaling.minScaledImageExtent = scaling.maxScaledImageExtent = {0, 0};
        VkSurfaceCapabilitiesKHR own{};
        if (capabilities(device, info->surface, own) == VK_SUCCESS) {
          scaling.minScaledImageExtent = own.minImageExtent;
          scaling.maxScaledImageExtent = own.maxImageExtent;
        }
        break;
      }
      case VK_STRUCTURE_TYPE_SURFACE_PRESENT_MODE_COMPATIBILITY_EXT: {
        auto& compatible = *reinterpret_cast<VkSurfacePresentModeCompatibilityEXT*>(s);
        VkPresentModeKHR modes[std::size(kPresentModes)];
        uint32_t count = 0;
        for (VkPresentModeKHR mode : kPresentModes)
          if (!asked || modesCompatible(base(info->surface), asked->presentMode, mode)) modes[count++] = mode;
        enumerate(count, &compatible.presentModeCount, compatible.pPresentModes, [&](uint32_t i, VkPresentModeKHR& m) { m = modes[i]; });
        break;
      }
      default: break;
    }
  return capabilities(device, info->surface, out->surfaceCapabilities);
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceSurfaceFormatsKHR(VkPhysicalDevice, VkSurfaceKHR,
                                                                    uint32_t* count,
                                                                    VkSurfaceFormatKHR* out) {
  return enumerate(std::size(kFormats), count, out,
                   [](uint32_t i, VkSurfaceFormatKHR& f) { f = kFormats[i]; });
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceSurfaceFormats2KHR(VkPhysicalDevice,
                                                                     const VkPhysicalDeviceSurfaceInfo2KHR*,
                                                                     uint32_t* count,
                                                                     VkSurfaceFormat2KHR* out) {
  return enumerate(std::size(kFormats), count, out,
                   [](uint32_t i, VkSurfaceFormat2KHR& f) { f.surfaceFormat = kFormats[i]; });
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDeviceSurfacePresentModesKHR(VkPhysicalDevice, VkSurfaceKHR,
                                                                         uint32_t* count,
                                                                         VkPresentModeKHR* out) {
  return enumerate(std::size(kPresentModes), count, out,
                   [](uint32_t i, VkPresentModeKHR& m) { m = kPresentModes[i]; });
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetPhysicalDevicePresentRectanglesKHR(VkPhysicalDevice, VkSurfaceKHR surface,
                                                                       uint32_t* count, VkRect2D* out) {
  WindowState state = queryWindow(base(surface));
  if (!state.alive) return VK_ERROR_SURFACE_LOST_KHR;
  return enumerate(1, count, out, [&](uint32_t, VkRect2D& r) { r = {{0, 0}, state.extent}; });
}

VKAPI_ATTR VkResult VKAPI_CALL
vkGetDeviceGroupPresentCapabilitiesKHR(VkDevice, VkDeviceGroupPresentCapabilitiesKHR* out) {
  std::fill(std::begin(out->presentMask), std::end(out->presentMask), 0);
  out->presentMask[0] = 1;
  out->modes = VK_DEVICE_GROUP_PRESENT_MODE_LOCAL_BIT_KHR;
  return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL vkGetDeviceGroupSurfacePresentModesKHR(VkDevice, VkSurfaceKHR,
                                                                      VkDeviceGroupPresentModeFlagsKHR* out) {
  *out = VK_DEVICE_GROUP_PRESENT_MODE_LOCAL_BIT_KHR;
  return VK_SUCCESS;
}

}  // namespace pumice::icd
