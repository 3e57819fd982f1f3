//! Finds the nearest intersection of a ray with many shapes: the `bvh` crate's hierarchy, walked
//! with a distance bound and without allocation.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::{Bvh, BvhNode};
use nalgebra::Point3;

use crate::shape::{Intersection, Primitive, Ray};
use crate::vector::Vec3;

/// Forms in a hierarchy of boxes; those without bounds beside it.
pub(crate) struct Hierarchy {
    primitives: Vec<Primitive>,
    bvh: Bvh<f64, 3>,
    /// The form of each leaf.
    leaves: Vec<usize>,
    unbounded: Vec<usize>,
    diameter: f64,
}

/// A form's box while the hierarchy is built.
struct Leaf {
    bounds: Aabb<f64, 3>,
    form: usize,
    node: usize,
}

impl Bounded<f64, 3> for Leaf {
    fn aabb(&self) -> Aabb<f64, 3> {
        self.bounds
    }
}

impl BHShape<f64, 3> for Leaf {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// Deeper than any hierarchy of 2^32 leaves whose splits are not absurd; a deeper one is walked
/// with a growing stack.
const USUAL_DEPTH: usize = 64;

impl Hierarchy {
    pub(crate) fn new(primitives: Vec<Primitive>) -> Self {
        let mut leaves = Vec::new();
        let mut unbounded = Vec::new();
        let mut whole: Option<[Vec3; 2]> = None;
        for (form, bounds) in primitives.iter().map(Primitive::bounds).enumerate() {
            let Some([low, high]) = bounds else {
                unbounded.push(form);
                continue;
            };
            // So that a flat form has a box with an inside.
            let pad = Vec3::repeat(1e-9 * (1.0 + low.amax().max(high.amax())));
            whole = Some(whole.map_or([low, high], |[a, b]| [a.inf(&low), b.sup(&high)]));
            leaves.push(Leaf {
                bounds: Aabb::with_bounds(Point3::from(low - pad), Point3::from(high + pad)),
                form,
                node: 0,
            });
        }
        Self {
            primitives,
            bvh: Bvh::build(&mut leaves),
            leaves: leaves.into_iter().map(|leaf| leaf.form).collect(),
            unbounded,
            diameter: whole.map_or(1.0, |[low, high]| (high - low).norm()),
        }
    }

    pub(crate) fn form(&self, index: usize) -> &Primitive {
        &self.primitives[index]
    }

    /// Diagonal of the box around all bounded forms.
    pub(crate) fn diameter(&self) -> f64 {
        self.diameter
    }

    /// The nearest form that a ray meets between `near` and `far`, by its index.
    pub(crate) fn nearest(&self, ray: &Ray, near: f64, far: f64) -> Option<(usize, Intersection)> {
        let mut best = None;
        let mut far = far;
        self.walk(ray, near, far, |form| {
            if let Some(meeting) = self.primitives[form].meet(ray, near, far) {
                far = meeting.distance;
                best = Some((form, meeting));
            }
            Some(far)
        });
        best
    }

    /// Whether a ray meets anything between `near` and `far`.
    pub(crate) fn blocked(&self, ray: &Ray, near: f64, far: f64) -> bool {
        let mut met = false;
        self.walk(ray, near, far, |form| {
            met = self.primitives[form].meet(ray, near, far).is_some();
            (!met).then_some(far)
        });
        met
    }

    /// Offers every form that the ray may meet to `visit`, which returns how far to go on looking,
    /// or `None` to stop.
    fn walk(&self, ray: &Ray, near: f64, far: f64, mut visit: impl FnMut(usize) -> Option<f64>) {
        let mut far = far;
        for &form in &self.unbounded {
            match visit(form) {
                Some(bound) => far = bound,
                None => return,
            }
        }
        if self.bvh.nodes.is_empty() {
            return;
        }
        let inverse = ray.direction.map(|d| 1.0 / d);
        // Nodes that are still to be seen, with the distance of their boxes.
        let mut stack = Stack::new();
        let mut node = 0;
        loop {
            match self.bvh.nodes[node] {
                BvhNode::Leaf { shape_index, .. } => match visit(self.leaves[shape_index]) {
                    Some(bound) => far = bound,
                    None => return,
                },
                BvhNode::Node {
                    child_l_index,
                    child_l_aabb,
                    child_r_index,
                    child_r_aabb,
                    ..
                } => {
                    let left = entry(&child_l_aabb, ray, &inverse, near, far);
                    let right = entry(&child_r_aabb, ray, &inverse, near, far);
                    match (left, right) {
                        (Some(l), Some(r)) if l <= r => {
                            stack.push((child_r_index, r));
                            node = child_l_index;
                            continue;
                        }
                        (Some(l), Some(_)) => {
                            stack.push((child_l_index, l));
                            node = child_r_index;
                            continue;
                        }
                        (Some(_), None) => {
                            node = child_l_index;
                            continue;
                        }
                        (None, Some(_)) => {
                            node = child_r_index;
                            continue;
                        }
                        (None, None) => {}
                    }
                }
            }
            node = loop {
                match stack.pop() {
                    Some((next, distance)) if distance < far => break next,
                    Some(_) => {}
                    None => return,
                }
            };
        }
    }
}

/// A stack on the stack, as long as that is enough.
struct Stack {
    fixed: [(usize, f64); USUAL_DEPTH],
    used: usize,
    more: Vec<(usize, f64)>,
}

impl Stack {
    fn new() -> Self {
        Self {
            fixed: [(0, 0.0); USUAL_DEPTH],
            used: 0,
            more: Vec::new(),
        }
    }

    fn push(&mut self, entry: (usize, f64)) {
        if let Some(slot) = self.fixed.get_mut(self.used) {
            *slot = entry;
            self.used += 1;
        } else {
            self.more.push(entry);
        }
    }

    fn pop(&mut self) -> Option<(usize, f64)> {
        self.more.pop().or_else(|| {
            self.used = self.used.checked_sub(1)?;
            Some(self.fixed[self.used])
        })
    }
}

/// Where a ray enters a box, if it does between `near` and `far`.
fn entry(bounds: &Aabb<f64, 3>, ray: &Ray, inverse: &Vec3, near: f64, far: f64) -> Option<f64> {
    let (mut first, mut last) = (near, far);
    for axis in 0..3 {
        let low = (bounds.min[axis] - ray.origin[axis]) * inverse[axis];
        let high = (bounds.max[axis] - ray.origin[axis]) * inverse[axis];
        // 0 times infinity, for a ray within a side of the box, is no number, and min and max
        // pass it over.
        first = first.max(low.min(high));
        last = last.min(low.max(high));
    }
    (first <= last).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_hierarchy_finds_what_trying_every_form_finds(
            centers in prop::collection::vec(prop::array::uniform3(-5.0..5.0_f64), 1..60),
            aim in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let primitives: Vec<Primitive> = centers
                .iter()
                .enumerate()
                .map(|(index, center)| match index % 3 {
                    0 => Primitive::Sphere { center: (*center).into(), radius: 0.4 },
                    1 => Primitive::Parallelogram {
                        corner: (*center).into(), u: Vec3::x(), v: Vec3::z(),
                    },
                    _ => Primitive::Plane { point: Vec3::from(*center) * 3.0, normal: Vec3::y() },
                })
                .collect();
            let ray = Ray {
                origin: Vec3::new(0.0, 0.0, 9.0),
                direction: (Vec3::from(aim) - Vec3::new(0.0, 0.0, 9.0)).normalize(),
            };
            let brute = primitives
                .iter()
                .filter_map(|form| form.meet(&ray, 1e-9, f64::INFINITY))
                .map(|meeting| meeting.distance)
                .reduce(f64::min);
            let hierarchy = Hierarchy::new(primitives);
            let found = hierarchy.nearest(&ray, 1e-9, f64::INFINITY);
            prop_assert_eq!(found.map(|(_, meeting)| meeting.distance), brute);
            prop_assert_eq!(hierarchy.blocked(&ray, 1e-9, f64::INFINITY), brute.is_some());
            if let Some(distance) = brute {
                prop_assert!(!hierarchy.blocked(&ray, 1e-9, distance));
            }
        }
    }

    #[test]
    fn many_forms_in_one_place_do_not_overflow_anything() {
        let sphere = Primitive::Sphere {
            center: Vec3::zeros(),
            radius: 1.0,
        };
        let hierarchy = Hierarchy::new(vec![sphere; 20_000]);
        let ray = Ray {
            origin: Vec3::z() * 5.0,
            direction: -Vec3::z(),
        };
        assert!(hierarchy.blocked(&ray, 1e-9, 10.0));
    }
}
