//! Triangle meshes, read from OBJ files or computed from a formula.

use std::f64::consts::TAU;
use std::path::Path;

use crate::error::{Error, MeshProblem, Result};
use crate::shape::Triangle;
use crate::vector::Vec3;

/// Most triangles of one mesh; they take about half a gigabyte.
pub(crate) const MAX_TRIANGLES: usize = 2_000_000;

/// Reads an OBJ file. Polygons become triangles, triangles without area are left out, and where
/// the file has no normals the triangles stay flat.
pub(crate) fn read(path: &Path) -> Result<Vec<Triangle>> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let file = std::fs::File::open(path).map_err(|reason| Error::Read {
        path: path.to_owned(),
        reason,
    })?;
    let wrong = |problem| Error::Mesh {
        path: path.to_owned(),
        problem,
    };
    // The scene says what the mesh is made of, so material files are not looked for.
    let no_materials = |_: &Path| tobj::MTLLoadResult::Ok(Default::default());
    let (models, _) =
        tobj::load_obj_buf(&mut std::io::BufReader::new(file), &options, no_materials)
            .map_err(|error| wrong(MeshProblem::Format(error.to_string())))?;
    let mut triangles = Vec::new();
    for model in models {
        append(&model.mesh, &mut triangles).map_err(wrong)?;
    }
    if triangles.is_empty() {
        return Err(wrong(MeshProblem::Empty));
    }
    Ok(triangles)
}

fn append(mesh: &tobj::Mesh, triangles: &mut Vec<Triangle>) -> Result<(), MeshProblem> {
    let found = triangles.len() + mesh.indices.len() / 3;
    if found > MAX_TRIANGLES {
        return Err(MeshProblem::TooLarge {
            found,
            limit: MAX_TRIANGLES,
        });
    }
    let vectors = |numbers: &[f32]| -> Vec<Vec3> {
        numbers
            .chunks_exact(3)
            .map(|c| Vec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])))
            .collect()
    };
    let points = vectors(&mesh.positions);
    let normals = vectors(&mesh.normals);
    if let Some(bad) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        return Err(MeshProblem::Vertex(bad + 1));
    }
    for (face, corners) in mesh.indices.chunks_exact(3).enumerate() {
        let corner = |k: usize| points.get(corners[k] as usize).copied();
        // The reader has checked that these exist.
        let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else {
            continue;
        };
        let own = [0, 1, 2].map(|k| {
            let index = mesh.normal_indices.get(3 * face + k);
            index
                .and_then(|&index| normals.get(index as usize))
                .copied()
        });
        triangles.extend(triangle([a, b, c], own));
    }
    Ok(())
}

/// A triangle with these corners, and with its flat normal where one of its own is missing or
/// means nothing; `None` without an area.
fn triangle([a, b, c]: [Vec3; 3], normals: [Option<Vec3>; 3]) -> Option<Triangle> {
    let edges = [b - a, c - a];
    let flat = edges[0].cross(&edges[1]);
    let area = flat.norm();
    if !(area > 0.0 && area.is_normal()) {
        return None;
    }
    let flat = flat / area;
    let smooth = |normal: Option<Vec3>| {
        normal
            .and_then(|n| n.try_normalize(1e-30))
            .filter(|n| n.iter().all(|c| c.is_finite()))
            // Both sides of a mesh are seen: only the line of a normal counts.
            .map(|n| if n.dot(&flat) < 0.0 { -n } else { n })
            .unwrap_or(flat)
    };
    Some(Triangle {
        corner: a,
        edges,
        normals: normals.map(smooth),
    })
}

/// A tube around the (2, 3) torus knot, about 2 across: `around` quadrilaterals around the tube,
/// `along` along it.
pub(crate) fn torus_knot(along: usize, around: usize) -> Vec<Triangle> {
    let curve = |t: f64| {
        let (s3, c3) = (3.0 * t).sin_cos();
        let (s2, c2) = (2.0 * t).sin_cos();
        let ring = 2.0 + c3;
        Vec3::new(ring * c2, ring * s2, s3) / 3.0
    };
    let tube = 0.21;
    let vertex = |i: usize, j: usize| -> (Vec3, Vec3) {
        let t = (i % along) as f64 / along as f64 * TAU;
        let (center, step) = (curve(t), 1e-4);
        let (before, after) = (curve(t - step), curve(t + step));
        let tangent = (after - before).normalize();
        // The curve keeps clear of its own axis, so the way outwards is never along it.
        let outwards = center - tangent * tangent.dot(&center);
        let side = tangent.cross(&outwards).normalize();
        let outwards = side.cross(&tangent);
        let (sin, cos) = ((j % around) as f64 / around as f64 * TAU).sin_cos();
        let normal = outwards * cos + side * sin;
        (center + normal * tube, normal)
    };
    let mut triangles = Vec::with_capacity(2 * along * around);
    for i in 0..along {
        for j in 0..around {
            let corners =
                [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)].map(|(i, j)| vertex(i, j));
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let chosen = [corners[a], corners[b], corners[c]];
                triangles.extend(triangle(chosen.map(|v| v.0), chosen.map(|v| Some(v.1))));
            }
        }
    }
    triangles
}

/// A mesh scaled, turned about x, y and z by degrees, and moved.
pub(crate) fn placed(
    triangles: Vec<Triangle>,
    scale: f64,
    rotate: [f64; 3],
    translate: [f64; 3],
) -> Vec<Triangle> {
    let [x, y, z] = rotate.map(f64::to_radians);
    let turn = nalgebra::Rotation3::from_euler_angles(x, y, z);
    let translate = Vec3::from(translate);
    triangles
        .into_iter()
        .map(|triangle| Triangle {
            corner: turn * triangle.corner * scale + translate,
            edges: triangle.edges.map(|edge| turn * edge * scale),
            normals: triangle.normals.map(|normal| turn * normal),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn read_text(text: &str) -> Result<Vec<Triangle>> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        read(file.path())
    }

    #[test]
    fn polygons_become_triangles_and_degenerate_ones_are_left_out() {
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 1 2 2\nf 1 1 1\n";
        let triangles = read_text(square).unwrap();
        assert_eq!(triangles.len(), 2);
        assert_eq!(triangles[0].normals, [Vec3::z(); 3]);
    }

    #[test]
    fn bad_files_are_errors_that_name_file_and_vertex() {
        for (text, part) in [
            ("", "no triangle"),
            ("v 0 0 0\nv 1 0 0\nf 1 2 2\n", "no triangle"),
            (
                "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
                "vertex 2 is not finite",
            ),
            (
                "v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n",
                "vertex 2 is not finite",
            ),
            ("v 0 0 0\nf 1 2 3\n", "not a readable OBJ"),
            ("v 0 0\n", "not a readable OBJ"),
            ("f 99999999999999999999 1 2\n", "not a readable OBJ"),
        ] {
            let error = read_text(text).unwrap_err().to_string();
            assert!(error.contains(part), "{text:?}: {error}");
        }
        assert!(matches!(
            read("nowhere.obj".as_ref()),
            Err(Error::Read { .. })
        ));
    }

    #[test]
    fn the_knot_is_closed_and_its_normals_point_outwards() {
        let triangles = torus_knot(60, 12);
        assert_eq!(triangles.len(), 1440);
        // The vector areas of a closed surface add up to nothing, and the divergence theorem
        // gives a positive volume where the normals point outwards.
        let mut area = Vec3::zeros();
        let mut volume = 0.0;
        for triangle in &triangles {
            let vector_area = triangle.edges[0].cross(&triangle.edges[1]) / 2.0;
            area += vector_area;
            volume += vector_area.dot(&triangle.corner) / 3.0;
            assert!(vector_area.normalize().dot(&triangle.normals[0]) > 0.8);
        }
        assert!(area.norm() < 1e-12 && volume > 0.0, "{area} {volume}");
    }
}
