//! The 205 pairs of directions, from the geometry of the apparatus.
//!
//! One lamp shines from a fixed direction. The camera stands at seven stations around the sample,
//! at 22.5, 45, ..., 157.5 degrees from the lamp. A robot turns the sample's normal through a
//! lattice on half of the sky, the half on one side of the plane of lamp and camera (for an
//! isotropic surface the other half is its mirror image). Whatever brings lamp or camera too near
//! the horizon is not measured, which leaves 55, 48, 39, 28, 19, 12 and 4 orientations for the
//! seven stations.
//!
//! The lattice is an octahedron with a corner at the lamp, its faces halved three times and drawn
//! out onto the sphere: 64 normals above the lamp's horizon. That the real apparatus used this
//! lattice is inferred from the database's `table.txt`, which these directions match to its printed
//! precision (measurements 27 to 30, with the lamp equally high, stand in another order there).
//! Thirty pairs of measurements are reciprocal to each other, ten measurements to themselves.

use std::f64::consts::PI;

use super::MEASUREMENTS;
use crate::geometry::{Angles, DirectionPair, Vector, dot};

/// Measurements per camera station, in the order of the measurements.
pub const BLOCKS: [usize; 7] = [55, 48, 39, 28, 19, 12, 4];

/// Segments along an edge of the octahedron: three halvings.
const SEGMENTS: i32 = 8;
/// Largest angle between normal and camera; the lattice has none between 83.9 degrees and this.
const CAMERA_LIMIT: f64 = 85.0 * PI / 180.0;

/// Angle between lamp and camera at a station, 0 to 6, in radians: (`station` + 1) times 22.5
/// degrees.
#[must_use]
pub fn station_angle(station: usize) -> f64 {
    (station as f64 + 1.0) * PI / 8.0
}

/// The pairs of directions in the order of CUReT's measurements: by station, then by falling
/// `theta_i`, then by `phi_i` from -pi (printed as pi) upwards.
#[must_use]
pub fn directions() -> Vec<DirectionPair> {
    angles().into_iter().map(DirectionPair::from).collect()
}

fn angles() -> Vec<Angles> {
    let mut all = Vec::with_capacity(MEASUREMENTS);
    for station in 0..BLOCKS.len() {
        let (sin, cos) = station_angle(station).sin_cos();
        let mut block: Vec<Angles> = normals()
            .filter_map(|normal| seen_from(normal, [sin, 0.0, cos]))
            .collect();
        // Rounded, so that orientations with the lamp equally high count as such on any machine.
        let order = |d: &Angles| {
            let phi = if d.phi_i == PI { -PI } else { d.phi_i };
            [-d.theta_i, phi].map(|angle| (angle * 1e9).round() as i64)
        };
        block.sort_by_key(order);
        all.append(&mut block);
    }
    all
}

/// The lattice: every normal in the sky above the lamp's horizon, on one side of the plane of
/// lamp and camera, that plane included.
fn normals() -> impl Iterator<Item = Vector> {
    (-SEGMENTS..=SEGMENTS).flat_map(|i| {
        (0..SEGMENTS - i.abs()).map(move |j| {
            let [x, y, z] = lattice_point([i.abs(), j, SEGMENTS - i.abs() - j]);
            [if i < 0 { -x } else { x }, if j > 0 { -y } else { y }, z]
        })
    })
}

/// A point of one face: three numbers that add up to [`SEGMENTS`], as on a flat triangle. It is
/// halfway between two points of the next coarser lattice, and those between two others, up to
/// the corners.
fn lattice_point(index: [i32; 3]) -> Vector {
    if index.contains(&SEGMENTS) {
        return index.map(|steps| f64::from(steps / SEGMENTS));
    }
    // The finest step that divides all three; in units of it exactly two of them are odd.
    let step = 1 << (index[0] | index[1] | index[2]).trailing_zeros();
    let (mut one, mut other) = (index, index);
    let mut sign = step;
    for axis in (0..3).filter(|&axis| index[axis] / step % 2 == 1) {
        one[axis] += sign;
        other[axis] -= sign;
        sign = -sign;
    }
    let (one, other) = (lattice_point(one), lattice_point(other));
    unit([one[0] + other[0], one[1] + other[1], one[2] + other[2]])
}

/// Lamp (along z) and camera as the sample with this normal sees them, if both are high enough.
fn seen_from(normal: Vector, camera: Vector) -> Option<Angles> {
    let [x, _, z] = normal;
    // The sample's first axis stays in the plane of lamp and camera.
    let first = unit([-z, 0.0, x]);
    let second = cross(normal, first);
    let polar = |direction: Vector| {
        // In the plane and along the normal the azimuth is exact, not a matter of rounding.
        let [a, b] = [dot(direction, first), dot(direction, second)]
            .map(|length| if length.abs() < 1e-12 { 0.0 } else { length });
        (a.hypot(b).atan2(dot(direction, normal)), b.atan2(a))
    };
    let (theta_i, phi_i) = polar([0.0, 0.0, 1.0]);
    let (theta_o, phi_o) = polar(camera);
    (theta_o < CAMERA_LIMIT).then_some(Angles {
        theta_i,
        phi_i,
        theta_o,
        phi_o,
    })
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|part| part / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each pair with the index of its station.
    fn with_stations() -> Vec<(usize, Angles)> {
        let stations = BLOCKS
            .iter()
            .enumerate()
            .flat_map(|(s, &count)| vec![s; count]);
        let all = angles();
        assert_eq!(all.len(), BLOCKS.iter().sum::<usize>());
        stations.zip(all).collect()
    }

    /// Greatest difference in the three numbers that an isotropic surface sees.
    fn apart(a: &DirectionPair, b: &DirectionPair) -> f64 {
        let (of_a, of_b) = (Angles::of(a), Angles::of(b));
        let differences = [
            of_a.theta_i - of_b.theta_i,
            of_a.theta_o - of_b.theta_o,
            a.cos_between() - b.cos_between(),
        ];
        differences
            .into_iter()
            .fold(0.0, |most, part| part.abs().max(most))
    }

    #[test]
    fn there_are_as_many_measurements_as_in_the_database() {
        assert_eq!(directions().len(), MEASUREMENTS);
        assert_eq!(BLOCKS.iter().sum::<usize>(), MEASUREMENTS);
    }

    #[test]
    fn the_angle_between_lamp_and_camera_is_that_of_the_station() {
        for (station, pair) in with_stations() {
            let angle = DirectionPair::from(pair).cos_between().acos();
            assert!(
                (angle - station_angle(station)).abs() < 1e-12,
                "{station}: {pair:?}"
            );
        }
    }

    #[test]
    fn lamp_and_camera_stay_above_the_horizon() {
        let highest =
            |angle: fn(&Angles) -> f64| angles().iter().map(angle).fold(0.0, f64::max).to_degrees();
        assert!((highest(|d| d.theta_i) - 78.75).abs() < 1e-9);
        let camera = highest(|d| d.theta_o);
        assert!((83.8..84.0).contains(&camera), "{camera}");
    }

    #[test]
    fn all_pairs_are_distinct() {
        let all = directions();
        for (k, a) in all.iter().enumerate() {
            for b in &all[..k] {
                assert!(apart(a, b) > 1e-6, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn each_station_has_the_mirror_direction_exactly_once() {
        let mut seen = vec![];
        for (index, (station, d)) in with_stations().into_iter().enumerate() {
            // Equal polar angles that add up to the angle between: the normal is the bisector.
            if (d.theta_i - d.theta_o).abs() < 1e-9
                && (d.theta_i + d.theta_o - station_angle(station)).abs() < 1e-9
            {
                seen.push(index + 1);
            }
        }
        assert_eq!(seen, [54, 97, 131, 161, 183, 196, 202]);
    }

    #[test]
    fn thirty_pairs_are_reciprocal_and_ten_measurements_to_themselves() {
        let all = directions();
        let (mut pairs, mut alone) = (0, 0);
        for (k, a) in all.iter().enumerate() {
            for (j, b) in all[..=k].iter().map(|pair| pair.swapped()).enumerate() {
                let same = apart(a, &b) < 1e-9;
                *(if j == k { &mut alone } else { &mut pairs }) += usize::from(same);
            }
        }
        assert_eq!((pairs, alone), (30, 10));
    }

    #[test]
    fn a_lattice_point_on_an_edge_divides_the_right_angle_evenly() {
        for i in 0..=SEGMENTS {
            let [x, y, z] = lattice_point([i, 0, SEGMENTS - i]);
            let expected = f64::from(i) * PI / 16.0;
            assert!((x.atan2(z) - expected).abs() < 1e-14 && y == 0.0);
        }
    }
}
