//! Numbers for samples: an Owen-scrambled Sobol sequence per pixel and purpose, so that a number
//! depends on what it is for and on nothing else, neither on threads nor on work left out.

/// What a sample's numbers are for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    /// The point within the pixel.
    Pixel,
    /// A point on a light, by its index, from the n-th surface of a path.
    Light(u32, usize),
    /// A direction, and whether to go on, at the n-th surface of a path.
    Scatter(u32),
}

/// The seed of a pixel's sequences.
pub(crate) fn pixel_seed(seed: u32, pixel: u32) -> u32 {
    mix(mix(seed ^ 0x9e37_79b9).wrapping_add(pixel))
}

/// Four numbers in \[0, 1) for the `sample`-th sample of a pixel, below 65536.
pub(crate) fn numbers(pixel_seed: u32, sample: u32, purpose: Purpose) -> [f64; 4] {
    let key = match purpose {
        Purpose::Pixel => 0,
        Purpose::Light(surface, light) => mix(mix(2 * surface + 1).wrapping_add(light as u32)),
        Purpose::Scatter(surface) => mix(2 * surface + 2),
    };
    sobol_burley::sample_4d(sample, 0, mix(pixel_seed ^ key)).map(f64::from)
}

/// A hash of 32 bits without collisions (Ellis's search for low bias, "lowbias32").
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_samples_fall_into_all_sixteen_parts_of_each_interval() {
        // A property of the Sobol sequence that scrambling keeps.
        for purpose in [Purpose::Pixel, Purpose::Light(0, 3), Purpose::Scatter(2)] {
            for dimension in 0..4 {
                let mut parts: Vec<usize> = (0..16)
                    .map(|s| (numbers(pixel_seed(7, 99), s, purpose)[dimension] * 16.0) as usize)
                    .collect();
                parts.sort_unstable();
                assert_eq!(parts, (0..16).collect::<Vec<_>>());
            }
        }
    }
}
