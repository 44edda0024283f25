/// renderer/film/first_hit.h - fills the outputs beside the radiance from the ray through a pixel's centre.
#pragma once

#include "renderer/image/radiance_image.h"
#include "renderer/integrator/integrator.h"

namespace narpa {

void resize(Aovs& aovs, std::size_t pixels);

/// Writes all but the variance, which is made 0.
void store_first_hit(const Frame& f, const Ray& ray, const Hit& hit, std::size_t pixel, Aovs& aovs);

}  // namespace narpa
