//! A point of a path on a surface.

use crate::shape::{Ray, SurfacePoint};
use crate::vector::{ShadingFrame, Vec3};
use elm_datasets::geometry::{DirectionPair, Vector};

/// Least cosine between the viewer and a smooth normal, which interpolation may tip away.
const MIN_COSINE: f64 = 1e-3;

/// A surface point with everything that depends on the viewer but not on the light.
pub(crate) struct Vertex {
    pub(crate) point: SurfacePoint,
    /// About the shading normal, on the viewer's side.
    pub(crate) frame: ShadingFrame,
    pub(crate) geometric: Vec3,
    pub(crate) outgoing: Vector,
    pub(crate) material: usize,
}

impl Vertex {
    pub(crate) fn new(point: SurfacePoint, material: usize, ray: &Ray) -> Self {
        let to_viewer = -ray.direction;
        let towards = |n: Vec3, w: Vec3| if n.dot(&w) < 0.0 { -n } else { n };
        let geometric = towards(point.geometric, to_viewer);
        let mut shading = towards(point.shading, geometric);
        let cosine = shading.dot(&to_viewer);
        if cosine < MIN_COSINE {
            shading = (shading + to_viewer * (MIN_COSINE - cosine)).normalize();
        }
        let frame = ShadingFrame::with_tangent(shading, point.tangent);
        Self {
            point,
            outgoing: frame.local(&to_viewer),
            frame,
            geometric,
            material,
        }
    }

    /// Whether a direction is below the surface, of the form or of the smooth surface.
    pub(crate) fn is_below(&self, direction: Vec3, cosine: f64) -> bool {
        cosine <= 0.0 || self.geometric.dot(&direction) <= 0.0
    }

    /// Where a ray in this direction starts: on the viewer's side, raised to the smooth surface.
    pub(crate) fn ray(&self, direction: Vec3) -> Ray {
        let lift = self.point.lifted - self.point.position;
        let outwards = if lift.dot(&self.geometric) < 0.0 {
            Vec3::zeros()
        } else {
            lift
        };
        Ray {
            origin: self.point.position + outwards,
            direction,
        }
    }

    pub(crate) fn pair(&self, direction: Vec3) -> DirectionPair {
        DirectionPair {
            incident: self.frame.local(&direction),
            outgoing: self.outgoing,
        }
    }
}
