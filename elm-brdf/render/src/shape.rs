//! Rays and their intersections with spheres, planes, parallelograms and triangles.

use crate::vector::Vec3;

/// A half-line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub(crate) origin: Vec3,
    /// Of unit length.
    pub(crate) direction: Vec3,
}

impl Ray {
    pub(crate) fn at(&self, distance: f64) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// A surface of simple form.
#[derive(Debug, Clone)]
pub(crate) enum Primitive {
    Sphere { center: Vec3, radius: f64 },
    Plane { point: Vec3, normal: Vec3 },
    Parallelogram { corner: Vec3, u: Vec3, v: Vec3 },
    Triangle(Box<Triangle>),
}

/// A triangle with the normals of the smooth surface that it stands for.
#[derive(Debug, Clone)]
pub(crate) struct Triangle {
    pub(crate) corner: Vec3,
    pub(crate) edges: [Vec3; 2],
    /// At the corner and at the ends of both edges.
    pub(crate) normals: [Vec3; 3],
}

/// Where a ray met a form.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Intersection {
    pub(crate) distance: f64,
    /// Position along the edges, for parallelograms and triangles.
    uv: [f64; 2],
}

/// A point of a surface, as shading needs it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfacePoint {
    pub(crate) position: Vec3,
    /// Normal of the form itself.
    pub(crate) geometric: Vec3,
    /// Normal of the smooth surface.
    pub(crate) shading: Vec3,
    /// About along the surface: what azimuths count from where a material is not isotropic.
    pub(crate) tangent: Vec3,
    /// Where rays to lights start: the point itself, or raised onto the smooth surface.
    pub(crate) lifted: Vec3,
}

impl Primitive {
    /// The nearest meeting farther than `near` and nearer than `far`.
    pub(crate) fn meet(&self, ray: &Ray, near: f64, far: f64) -> Option<Intersection> {
        let within = |distance: f64| distance > near && distance < far;
        match self {
            Self::Sphere { center, radius } => {
                let to_center = center - ray.origin;
                let along = to_center.dot(&ray.direction);
                // The distance of the ray from the centre, without cancellation (Haines et al.,
                // Precision Improvements for Ray/Sphere Intersection, Ray Tracing Gems, 2019).
                let across = to_center - ray.direction * along;
                let half_squared = radius * radius - across.norm_squared();
                if half_squared < 0.0 {
                    return None;
                }
                let half = half_squared.sqrt();
                let (first, second) = (along - half, along + half);
                let distance = if first > near { first } else { second };
                within(distance).then_some(Intersection {
                    distance,
                    uv: [0.0; 2],
                })
            }
            Self::Plane { point, normal } => {
                let distance = (point - ray.origin).dot(normal) / ray.direction.dot(normal);
                within(distance).then_some(Intersection {
                    distance,
                    uv: [0.0; 2],
                })
            }
            Self::Parallelogram { corner, u, v } => meet_edges(ray, corner, u, v)
                .filter(|m| within(m.distance) && m.uv[0] <= 1.0 && m.uv[1] <= 1.0),
            Self::Triangle(triangle) => {
                let [u, v] = &triangle.edges;
                meet_edges(ray, &triangle.corner, u, v)
                    .filter(|m| within(m.distance) && m.uv[0] + m.uv[1] <= 1.0)
            }
        }
    }

    /// The surface where a ray met it.
    pub(crate) fn surface(&self, ray: &Ray, meeting: Intersection) -> SurfacePoint {
        let flat = |position, normal, tangent| SurfacePoint {
            position,
            geometric: normal,
            shading: normal,
            tangent,
            lifted: position,
        };
        let position = ray.at(meeting.distance);
        match self {
            Self::Sphere { center, radius } => {
                let normal = (position - center).normalize();
                flat(center + normal * *radius, normal, around(normal))
            }
            Self::Plane { normal, .. } => flat(position, *normal, around(*normal)),
            Self::Parallelogram { u, v, .. } => flat(position, u.cross(v).normalize(), *u),
            Self::Triangle(triangle) => triangle.surface(meeting.uv),
        }
    }

    /// The smallest box around it, as two corners; `None` for a plane, which has none.
    pub(crate) fn bounds(&self) -> Option<[Vec3; 2]> {
        let around = |points: &[Vec3]| {
            points.iter().fold(
                [Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY)],
                |[low, high], point| [low.inf(point), high.sup(point)],
            )
        };
        match self {
            Self::Sphere { center, radius } => {
                let half = Vec3::repeat(*radius);
                Some([center - half, center + half])
            }
            Self::Plane { .. } => None,
            Self::Parallelogram { corner, u, v } => {
                Some(around(&[*corner, corner + u, corner + v, corner + u + v]))
            }
            Self::Triangle(triangle) => {
                let [u, v] = triangle.edges;
                let corner = triangle.corner;
                Some(around(&[corner, corner + u, corner + v]))
            }
        }
    }
}

impl Triangle {
    fn surface(&self, [s, t]: [f64; 2]) -> SurfacePoint {
        let [u, v] = self.edges;
        let geometric = u.cross(&v).normalize();
        let position = self.corner + u * s + v * t;
        let weights = [1.0 - s - t, s, t];
        let corners = [self.corner, self.corner + u, self.corner + v];
        let mut shading = Vec3::zeros();
        let mut lift = Vec3::zeros();
        for ((normal, corner), weight) in self.normals.iter().zip(corners).zip(weights) {
            shading += normal * weight;
            // Onto the tangent plane of each corner, where that lies above (Hanika, Hacking the
            // Shadow Terminator, Ray Tracing Gems II, 2021): a shadow then ends where the smooth
            // surface turns away, not in steps along the triangles.
            let below = (position - corner).dot(normal).min(0.0);
            lift -= normal * (below * weight);
        }
        let length = shading.norm();
        SurfacePoint {
            position,
            geometric,
            shading: if length > 0.0 {
                shading / length
            } else {
                geometric
            },
            tangent: around(geometric),
            lifted: position + lift,
        }
    }
}

/// The horizontal direction along a surface: around the vertical axis, and along x where the surface is
/// horizontal.
fn around(normal: Vec3) -> Vec3 {
    // Within a thousandth of a degree.
    const HORIZONTAL: f64 = 1e-5;
    let across = Vec3::y().cross(&normal);
    if across.norm() > HORIZONTAL {
        across
    } else {
        Vec3::x()
    }
}

/// Where a ray crosses the plane of two edges, if on their side of both (Moeller and Trumbore,
/// *Fast, Minimum Storage Ray/Triangle Intersection*, 1997).
fn meet_edges(ray: &Ray, corner: &Vec3, u: &Vec3, v: &Vec3) -> Option<Intersection> {
    let p = ray.direction.cross(v);
    let determinant = u.dot(&p);
    let inverse = 1.0 / determinant;
    let from_corner = ray.origin - corner;
    let s = from_corner.dot(&p) * inverse;
    let q = from_corner.cross(u);
    let t = ray.direction.dot(&q) * inverse;
    // Also false where the ray lies in the plane, and both are infinite or no number.
    (determinant != 0.0 && s >= 0.0 && t >= 0.0).then(|| Intersection {
        distance: v.dot(&q) * inverse,
        uv: [s, t],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f64; 3], direction: [f64; 3]) -> Ray {
        Ray {
            origin: origin.into(),
            direction: Vec3::from(direction).normalize(),
        }
    }

    fn distance(form: &Primitive, ray: &Ray) -> Option<f64> {
        form.meet(ray, 1e-9, f64::INFINITY).map(|m| m.distance)
    }

    #[test]
    fn a_ray_meets_a_sphere_from_outside_from_inside_and_not_behind() {
        let sphere = Primitive::Sphere {
            center: Vec3::zeros(),
            radius: 2.0,
        };
        assert_eq!(
            distance(&sphere, &ray([0.0, 0.0, 5.0], [0.0, 0.0, -1.0])),
            Some(3.0)
        );
        assert_eq!(
            distance(&sphere, &ray([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])),
            Some(3.0)
        );
        assert_eq!(
            distance(&sphere, &ray([0.0, 0.0, 5.0], [0.0, 0.0, 1.0])),
            None
        );
        assert_eq!(
            distance(&sphere, &ray([0.0, 2.1, 5.0], [0.0, 0.0, -1.0])),
            None
        );
    }

    #[test]
    fn a_parallelogram_ends_at_its_edges_and_a_triangle_at_its_diagonal() {
        let [u, v] = [Vec3::x() * 2.0, Vec3::y()];
        let square = Primitive::Parallelogram {
            corner: Vec3::zeros(),
            u,
            v,
        };
        let triangle = Primitive::Triangle(Box::new(Triangle {
            corner: Vec3::zeros(),
            edges: [u, v],
            normals: [Vec3::z(); 3],
        }));
        let down = |x, y| ray([x, y, 1.0], [0.0, 0.0, -1.0]);
        assert_eq!(distance(&square, &down(1.9, 0.9)), Some(1.0));
        assert_eq!(distance(&triangle, &down(1.9, 0.9)), None);
        assert_eq!(distance(&triangle, &down(0.5, 0.5)), Some(1.0));
        for (x, y) in [(-0.1, 0.5), (2.1, 0.5), (1.0, -0.1), (1.0, 1.1)] {
            assert_eq!(distance(&square, &down(x, y)), None, "{x} {y}");
        }
        assert_eq!(
            distance(&square, &ray([-1.0, 0.5, 0.0], [1.0, 0.0, 0.0])),
            None
        );
    }

    #[test]
    fn lifting_a_point_of_a_flat_triangle_leaves_it_where_it_is() {
        let triangle = Triangle {
            corner: Vec3::zeros(),
            edges: [Vec3::x(), Vec3::y()],
            normals: [Vec3::z(); 3],
        };
        let surface = triangle.surface([0.3, 0.4]);
        assert_eq!(surface.lifted, surface.position);
        // With normals that lean outwards, as on a ball, the middle rises.
        let triangle = Triangle {
            normals: [[-1.0, -1.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]]
                .map(|n| Vec3::from(n).normalize()),
            ..triangle
        };
        assert!(triangle.surface([0.3, 0.3]).lifted.z > 0.0);
    }
}
