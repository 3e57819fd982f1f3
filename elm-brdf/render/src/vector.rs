//! Points and directions in the world, and the frame of a surface.

use elm_datasets::geometry::{Vector, tangents};

/// A point, direction or colour of the world.
pub(crate) type Vec3 = nalgebra::Vector3<f64>;

/// Linear red, green and blue.
pub(crate) type Rgb = [f64; 3];

/// No light.
pub(crate) const BLACK: Rgb = [0.0; 3];

/// Product, channel by channel.
pub(crate) fn times(a: Rgb, b: Rgb) -> Rgb {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// Every channel times `factor`.
pub(crate) fn scaled(a: Rgb, factor: f64) -> Rgb {
    a.map(|channel| channel * factor)
}

/// Adds `b` to `a`.
pub(crate) fn add(a: &mut Rgb, b: Rgb) {
    for (sum, term) in a.iter_mut().zip(b) {
        *sum += term;
    }
}

/// The largest channel.
pub(crate) fn largest(a: Rgb) -> f64 {
    a[0].max(a[1]).max(a[2])
}

/// Relative luminance of linear sRGB (ITU-R BT.709).
pub(crate) fn luminance(a: Rgb) -> f64 {
    0.2126 * a[0] + 0.7152 * a[1] + 0.0722 * a[2]
}

/// An orthonormal frame with its third axis along a surface normal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShadingFrame {
    tangent: Vec3,
    bitangent: Vec3,
    /// The third axis.
    pub(crate) normal: Vec3,
}

impl ShadingFrame {
    /// A frame about the unit vector `n`, by [`tangents`].
    pub(crate) fn from_normal(n: Vec3) -> Self {
        let [tangent, bitangent] = tangents(n.into());
        Self {
            tangent: tangent.into(),
            bitangent: bitangent.into(),
            normal: n,
        }
    }

    /// A frame about the unit vector `n` whose first axis is what of `tangent` lies across it; any where
    /// nothing does.
    pub(crate) fn with_tangent(n: Vec3, tangent: Vec3) -> Self {
        let across = tangent - n * tangent.dot(&n);
        let length = across.norm();
        if length.is_nan() || length <= 1e-9 * tangent.norm() {
            return Self::from_normal(n);
        }
        let tangent = across / length;
        Self {
            tangent,
            bitangent: n.cross(&tangent),
            normal: n,
        }
    }

    /// A direction of the world in this frame.
    pub(crate) fn local(&self, w: &Vec3) -> Vector {
        [
            w.dot(&self.tangent),
            w.dot(&self.bitangent),
            w.dot(&self.normal),
        ]
    }

    /// A direction of this frame in the world.
    pub(crate) fn world(&self, v: Vector) -> Vec3 {
        self.tangent * v[0] + self.bitangent * v[1] + self.normal * v[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_frame_is_orthonormal_and_goes_there_and_back(
            theta in 0.0..std::f64::consts::PI, phi in -3.2..3.2_f64,
        ) {
            let n = Vec3::from(elm_datasets::geometry::cartesian(theta, phi));
            let frame = ShadingFrame::from_normal(n);
            prop_assert!((frame.tangent.cross(&frame.bitangent) - n).norm() < 1e-14);
            let w = Vec3::new(0.3, -0.5, 0.8).normalize();
            prop_assert!((frame.world(frame.local(&w)) - w).norm() < 1e-14);
            let frame = ShadingFrame::with_tangent(n, w);
            prop_assert!((frame.tangent.cross(&frame.bitangent) - n).norm() < 1e-12);
            prop_assert!((frame.world(frame.local(&w)) - w).norm() < 1e-12);
            let along = ShadingFrame::with_tangent(n, n * 2.0);
            prop_assert!((along.tangent.cross(&along.bitangent) - n).norm() < 1e-14);
        }
    }
}
