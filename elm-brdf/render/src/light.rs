//! Lights: the light that they send to a point, how to sample them, and the most that they can
//! contribute.

use std::f64::consts::PI;

use crate::environment::{Environment, LightSample};
use crate::shape::Primitive;
use crate::vector::{BLACK, Rgb, Vec3, scaled};

/// A light.
#[derive(Debug, Clone)]
pub(crate) enum Light {
    Directional { towards: Vec3, irradiance: Rgb },
    Point { position: Vec3, intensity: Rgb },
    Area(Area),
    Environment(Environment),
}

/// A parallelogram that shines to one side.
#[derive(Debug, Clone)]
pub(crate) struct Area {
    pub(crate) corner: Vec3,
    pub(crate) edges: [Vec3; 2],
    pub(crate) radiance: Rgb,
}

impl Light {
    /// Whether sampling directions alone can find it.
    pub(crate) fn has_extent(&self) -> bool {
        matches!(self, Self::Area(_) | Self::Environment(_))
    }

    /// A direction from `point`, whose normal is `normal`, to the light; `None` if none of its
    /// light arrives from where `u` leads.
    pub(crate) fn sample(&self, point: Vec3, normal: Vec3, u: [f64; 2]) -> Option<LightSample> {
        match self {
            Self::Directional {
                towards,
                irradiance,
            } => Some(LightSample {
                direction: *towards,
                distance: f64::INFINITY,
                irradiance: *irradiance,
                density: None,
            }),
            Self::Point {
                position,
                intensity,
            } => {
                let to_light = position - point;
                let squared = to_light.norm_squared();
                let distance = squared.sqrt();
                (distance > 0.0).then(|| LightSample {
                    direction: to_light / distance,
                    distance,
                    irradiance: scaled(*intensity, 1.0 / squared),
                    density: None,
                })
            }
            Self::Area(area) => area.sample(point, u),
            Self::Environment(environment) => environment.sample(normal, u),
        }
    }

    /// An upper bound on the irradiance that it gives a surface at `point`, channel by channel.
    pub(crate) fn most_irradiance(&self, point: Vec3, normal: Vec3) -> Rgb {
        match self {
            Self::Directional {
                towards,
                irradiance,
            } => scaled(*irradiance, towards.dot(&normal).max(0.0)),
            Self::Point {
                position,
                intensity,
            } => {
                let to_light = position - point;
                let squared = to_light.norm_squared();
                let cosine = to_light.dot(&normal) / squared.sqrt();
                // No number where the light is at the point itself.
                let factor = if squared > 0.0 {
                    cosine.max(0.0) / squared
                } else {
                    0.0
                };
                scaled(*intensity, factor)
            }
            Self::Area(area) => scaled(area.radiance, area.most_solid_angle(point)),
            Self::Environment(_) => [f64::INFINITY; 3],
        }
    }
}

impl Area {
    pub(crate) fn form(&self) -> Primitive {
        Primitive::Parallelogram {
            corner: self.corner,
            u: self.edges[0],
            v: self.edges[1],
        }
    }

    /// Radiance towards a viewer who looks along `direction`.
    pub(crate) fn radiance(&self, direction: Vec3) -> Rgb {
        let facing = self.edges[0].cross(&self.edges[1]).dot(&direction) < 0.0;
        if facing { self.radiance } else { BLACK }
    }

    /// Density in solid angle, seen from `distance` away along `direction`, of sampling it evenly
    /// by area.
    pub(crate) fn density(&self, direction: Vec3, distance: f64) -> f64 {
        let area = self.edges[0].cross(&self.edges[1]);
        // Projected: the cosine is that between the direction and the vector area.
        distance * distance / area.dot(&direction).abs()
    }

    fn sample(&self, point: Vec3, [s, t]: [f64; 2]) -> Option<LightSample> {
        let to_light = self.corner + self.edges[0] * s + self.edges[1] * t - point;
        let distance = to_light.norm();
        let direction = to_light / distance;
        let radiance = self.radiance(direction);
        let density = self.density(direction, distance);
        (radiance != BLACK && density.is_finite() && density > 0.0).then(|| LightSample {
            direction,
            distance,
            irradiance: scaled(radiance, 1.0 / density),
            density: Some(density),
        })
    }

    /// It is no larger than its area at the distance of its nearest possible point, seen face on,
    /// and no larger than half of all directions.
    fn most_solid_angle(&self, point: Vec3) -> f64 {
        let [u, v] = self.edges;
        let to_center = (self.corner + (u + v) / 2.0 - point).norm();
        let reach = (u + v).norm().max((u - v).norm()) / 2.0;
        let nearest = (to_center - reach).max(0.0);
        (u.cross(&v).norm() / (nearest * nearest)).min(2.0 * PI)
    }
}

/// The power heuristic with exponent 2 (Veach, *Robust Monte Carlo Methods*, 1997): the weight of
/// a sample of density `own` that `other` might have found too.
pub(crate) fn power_heuristic(own: f64, other: f64) -> f64 {
    // As a ratio, so that large densities do not overflow.
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Light {
        Light::Area(Area {
            corner: Vec3::new(-0.5, -0.5, 2.0),
            edges: [Vec3::y(), Vec3::x()],
            radiance: [1.0; 3],
        })
    }

    #[test]
    fn sampling_a_rectangle_gives_the_irradiance_known_in_closed_form() {
        // A square of side 1 at distance 2, parallel and centred: four times the configuration
        // factor of a corner (Siegel and Howell, factor 10), with a = b = 1/4, times pi.
        let a = 0.25_f64;
        let root = (1.0 + a * a).sqrt();
        let factor = 4.0 * (2.0 * a / root * (a / root).atan()) / (2.0 * PI);
        let n = 200;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let u = [(i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64];
                let sample = square().sample(Vec3::zeros(), Vec3::z(), u).unwrap();
                sum += sample.irradiance[0] * sample.direction.z / (n * n) as f64;
            }
        }
        // The midpoint rule's error is of the order of 1/n^2.
        assert!((sum - factor * PI).abs() < 1e-5, "{sum} {}", factor * PI);
        assert!(square().most_irradiance(Vec3::zeros(), Vec3::z())[0] >= sum);
    }

    #[test]
    fn a_rectangle_shines_to_one_side_only() {
        let behind = Vec3::new(0.0, 0.0, 4.0);
        assert!(square().sample(behind, -Vec3::z(), [0.5, 0.5]).is_none());
    }

    #[test]
    fn weights_of_both_ways_of_sampling_add_up_to_one() {
        for (a, b) in [(1.0, 2.0), (1e-200, 1e-200), (1e200, 1e100), (3.0, 0.0)] {
            let sum = power_heuristic(a, b) + if b > 0.0 { power_heuristic(b, a) } else { 0.0 };
            assert!((sum - 1.0).abs() < 1e-15);
        }
    }
}
