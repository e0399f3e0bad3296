// The exact answer for one triangle at one pixel centre, in long double, also where vertices lie behind the eye.
#pragma once

#include "raster_fixture.h"

namespace pumice::raster::test {

struct Reference {
  using Real = long double;
  Real x[3], y[3], z[3], w[3], gradientX[3], gradientY[3], atOrigin[3];
  bool valid = false;

  Reference(const Draw& draw, const uint32_t (&slots)[3]) {
    const VkViewport& v = draw.state.viewport;
    for (int i = 0; i < 3; i++) {
      w[i] = draw.rows[3][slots[i]];
      x[i] = Real(draw.rows[0][slots[i]]) * v.width / 2 + w[i] * (v.x + Real(v.width) / 2);
      y[i] = Real(draw.rows[1][slots[i]]) * v.height / 2 + w[i] * (v.y + Real(v.height) / 2);
      z[i] = draw.rows[2][slots[i]];
    }
    Real det = 0;
    for (int i = 0; i < 3; i++) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      gradientX[i] = y[j] * w[k] - y[k] * w[j];
      gradientY[i] = w[j] * x[k] - w[k] * x[j];
      atOrigin[i] = x[j] * y[k] - x[k] * y[j];
      det += w[i] * atOrigin[i];
    }
    valid = det != 0;
    for (int i = 0; i < 3; i++) {
      gradientX[i] /= det;
      gradientY[i] /= det;
      atOrigin[i] /= det;
    }
  }
  //! (px, py, 1) = sum of weight(i) * (x, y, w)[i]: the sum of the weights is 1/w, that of weighted values is value/w.
  Real weight(int i, Real px, Real py) const { return gradientX[i] * px + gradientY[i] * py + atOrigin[i]; }
  Real sum(const Real (&values)[3], Real px, Real py) const {
    return weight(0, px, py) * values[0] + weight(1, px, py) * values[1] + weight(2, px, py) * values[2];
  }
  //! Signed distance in pixels to the nearest side of the visible part (edges, near and far where clipped); positive inside.
  Real distance(Real px, Real py, bool depthClip) const {
    Real nearest = 1e9L;
    for (int i = 0; i < 3; i++)
      nearest = std::min(nearest, weight(i, px, py) / std::max(std::hypot(gradientX[i], gradientY[i]), Real(1e-30L)));
    if (depthClip) {
      Real zx = 0, zy = 0;
      for (int i = 0; i < 3; i++) {
        zx += gradientX[i] * z[i];
        zy += gradientY[i] * z[i];
      }
      const Real depth = sum(z, px, py), slope = std::max(std::hypot(zx, zy), Real(1e-30L));
      nearest = std::min({nearest, depth / slope, (1 - depth) / slope});
    }
    return nearest;
  }
};

}  // namespace pumice::raster::test
