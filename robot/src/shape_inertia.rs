//! Mass properties of links computed from their shapes, for files whose mass properties are missing, incomplete or
//! impossible.

use crate::body_inertia::{RigidBody, rigid_bodies};
use crate::description::{Geometry, Inertial, JointKind, Link, RobotDescription};
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::inertia::{InertiaFault, RigidInertia};
use crate::mesh_key::MeshKey;
use crate::urdf::MissingInertia;
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::{HullCache, HullCfg, TriMesh, VolumeIntegrals};
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Density of water \[kg/m³\], for a link with a mass but without shapes.
const WATER_DENSITY: f64 = 1000.0;
/// Ratio of radius of gyration to reach of the shapes above which an inertia is an error of the file. The mass of a
/// body lies inside it, so that 1 is the physical bound. Inertias often include rotors behind gears, which raise the
/// ratio to a few.
const MAX_GYRATION_RATIO: f64 = 10.0;
/// Largest plausible density of a link \[kg/m³\]. Shapes that imply more are placeholders, such as boxes of 1 mm:
/// osmium has 22 600.
const MAX_PLAUSIBLE_DENSITY: f64 = 25_000.0;

/// Error of mass properties that are computed from shapes.
#[derive(Debug, thiserror::Error)]
pub enum ShapeInertiaError {
    /// The density of the configuration is not positive and finite.
    #[error("missing_inertia is {value}; {expected}")]
    Density {
        /// The density \[kg/m³\].
        value: f64,
        /// Accepted values.
        expected: &'static str,
    },
    /// A collision mesh cannot be read or has no hull.
    #[error("{at}: link {link:?}: {error}")]
    Mesh {
        /// Location of the collision element.
        at: SourceLocation,
        /// Name of the link.
        link: String,
        /// Error of the mesh file.
        #[source]
        error: Box<kinetoscope_scene::mesh::MeshError>,
    },
}

/// Convex hulls of mesh files, each computed once. Hulls are also stored in the hull cache on disk
/// ([`HullCache::default_location`]).
#[derive(Debug)]
pub struct HullSet<'c> {
    cache: HullCache,
    cfg: &'c HullCfg,
    by_mesh: BTreeMap<MeshKey, TriMesh>,
}

impl<'c> HullSet<'c> {
    /// Creates an empty set. `cfg` configures the hulls that are computed later.
    pub fn new(cfg: &'c HullCfg) -> Self {
        Self { cache: HullCache::default_location(), cfg, by_mesh: BTreeMap::new() }
    }

    /// Returns the convex hulls of all collision meshes of a robot, by file and scale. Hulls that are already in the
    /// set are not computed again.
    ///
    /// # Errors
    /// A mesh cannot be read or has no hull.
    pub fn of_collisions(
        mut self,
        description: &RobotDescription,
    ) -> Result<BTreeMap<MeshKey, TriMesh>, ShapeInertiaError> {
        let mut hulls = BTreeMap::new();
        for link in &description.links {
            for collision in &link.collisions {
                let Geometry::Mesh { path, scale, .. } = &collision.geometry else { continue };
                let key = MeshKey::new(path, scale);
                if hulls.contains_key(&key) {
                    continue;
                }
                let hull = match self.by_mesh.remove(&key) {
                    Some(hull) => hull,
                    None => self.cache.hull_of_file(path, (*scale).into(), self.cfg).map_err(|error| {
                        let (at, link) = (collision.source.clone(), link.name.clone());
                        ShapeInertiaError::Mesh { at, link, error: Box::new(error) }
                    })?,
                };
                hulls.insert(key, hull);
            }
        }
        Ok(hulls)
    }

    /// Convex hull of a mesh; `None` for other shapes and where the file cannot be read. Other users of the file report
    /// that error.
    fn of_mesh(&mut self, geometry: &Geometry) -> Option<&TriMesh> {
        let Geometry::Mesh { path, scale, .. } = geometry else { return None };
        let key = MeshKey::new(path, scale);
        if !self.by_mesh.contains_key(&key) {
            let hull = self.cache.hull_of_file(path, (*scale).into(), self.cfg).ok()?;
            self.by_mesh.insert(key.clone(), hull);
        }
        self.by_mesh.get(&key)
    }
}

/// Computes mass properties from shapes for a robot from URDF files: those of incomplete `<inertial>`s, and those of
/// links of moving bodies where no link has any (see [`MissingInertia`]). Also replaces inertias of moving bodies that
/// are impossible, or too large for the shapes of a free body. Adds a warning for each change, except for an incomplete
/// `<inertial>` that shapes complete, because the reader of the file reported it.
///
/// `floating_base` is true if the root link moves.
///
/// # Errors
/// The density of the configuration is not positive and finite.
pub fn complete(
    description: &mut RobotDescription,
    missing: MissingInertia,
    floating_base: bool,
    hulls: &mut HullSet<'_>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<(), ShapeInertiaError> {
    if let MissingInertia::Density(density) = missing
        && !(density.is_finite() && density > 0.0)
    {
        let expected = "a density must be positive and finite, in kg/m³; alternatively use MissingInertia::Minimal";
        return Err(ShapeInertiaError::Density { value: density, expected });
    }
    for link in &mut description.links {
        complete_partial(link, missing, hulls, diagnostics);
    }
    for body in rigid_bodies(description, floating_base).iter().filter(|body| body.moves) {
        let has_none = body.links.iter().all(|(link, _)| description.link(*link).inertial.is_none());
        match missing {
            MissingInertia::Density(density) if has_none => {
                for (link, _) in &body.links {
                    inertial_from_shapes(&mut description.links[link.0], density, hulls, diagnostics);
                }
            }
            _ => replace_implausible_inertias(description, body, floating_base, hulls, diagnostics),
        }
    }
    Ok(())
}

/// Sets the mass properties of a link without `<inertial>`. A link without shapes that have a volume stays without.
fn inertial_from_shapes(link: &mut Link, density: f64, hulls: &mut HullSet<'_>, diagnostics: &mut Vec<Diagnostic>) {
    let Some(shapes) = ShapeSolid::of(link, hulls) else { return };
    let mass = shapes.unit.mass * density;
    link.inertial = Some(shapes.inertial(link, mass));
    let message = format!(
        "link {:?} has no <inertial>: with {density} kg/m³ (missing_inertia) its {} shapes give it {} kg",
        link.name,
        shapes.kind,
        format_short(mass)
    );
    diagnostics.push(Diagnostic::new(DiagnosticKind::InertiaFromShapes, link.source.clone(), message));
}

/// Completes an `<inertial>` that lacks its mass or its inertia, or drops it if no mass can be computed.
fn complete_partial(
    link: &mut Link,
    missing: MissingInertia,
    hulls: &mut HullSet<'_>,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let Some(given) = link.partial_inertial.take() else { return };
    let mut warn = |message: String| {
        let kind = DiagnosticKind::InertiaFromShapes;
        diagnostics.push(Diagnostic::new(kind, given.source.clone(), format!("link {:?}: {message}", link.name)));
    };
    let shapes = ShapeSolid::of(link, hulls);
    let density = given.density.or(match missing {
        MissingInertia::Density(density) => Some(density),
        MissingInertia::Minimal => None,
    });
    let of_shapes = shapes.as_ref().zip(density).map(|(shapes, density)| shapes.unit.mass * density);
    let Some(mass) = given.mass.or(of_shapes) else {
        let why = if shapes.is_none() { "it has no shapes" } else { "missing_inertia is minimal" };
        return warn(format!("its <inertial> has no mass and {why}, so the <inertial> was ignored"));
    };
    let mut inertial = match &shapes {
        Some(shapes) => shapes.inertial(link, mass),
        None => solid_ball_inertial(link, mass, given.density.unwrap_or(WATER_DENSITY)),
    };
    if shapes.is_none() && given.inertia.is_none() && mass > 0.0 {
        warn(
            "the link has no shapes, so its inertia was set to that of a sphere of its mass with the density of water"
                .to_owned(),
        );
    }
    inertial.source = given.source.clone();
    // A given tensor is about the given origin, or else about the origin of the link.
    match (given.inertia, given.link_from_com) {
        (Some(inertia), pose) => {
            inertial.inertia = inertia;
            inertial.link_from_com = pose.unwrap_or_else(Pose::identity);
        }
        (None, Some(pose)) => inertial.link_from_com = pose.translation.into(),
        (None, None) => {}
    }
    link.inertial = Some(inertial);
}

/// Replaces implausible inertias by those of the shapes.
///
/// If the whole body is invalid, an inertia that is not positive definite is replaced, and so is one that violates the
/// triangle inequality and whose radius of gyration is too large for the shapes (see [`MAX_GYRATION_RATIO`]). On a body
/// that moves freely, a valid inertia with such a radius is replaced, too. On a body behind a joint it is kept, with a
/// warning: it may include the rotor of a gear. Links that would be denser than [`MAX_PLAUSIBLE_DENSITY`] are left out.
fn replace_implausible_inertias(
    description: &mut RobotDescription,
    body: &RigidBody,
    floating_base: bool,
    hulls: &mut HullSet<'_>,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut fused = RigidInertia::ZERO;
    for (link, body_from_link) in &body.links {
        if let Some(inertial) = &description.link(*link).inertial {
            fused = fused.combine(&RigidInertia::from_inertial(inertial).transformed(body_from_link));
        }
    }
    let is_faulty = fused.check().is_err();
    let is_free = match description.link(body.links[0].0).parent_joint {
        Some(joint) => description.joint(joint).kind == JointKind::Floating,
        None => floating_base,
    };
    for (id, _) in &body.links {
        let link = &description.links[id.0];
        let Some(inertial) = link.inertial.as_ref().filter(|inertial| inertial.mass > 0.0) else { continue };
        let own = RigidInertia::from_inertial(inertial);
        let fault = own.check().err().filter(|_| is_faulty);
        // Reading visual meshes takes time: they are used only where an inertia needs a repair.
        if fault.is_none() && link.collisions.is_empty() {
            continue;
        }
        let Some(shapes) =
            ShapeSolid::of(link, hulls).filter(|shapes| own.mass < MAX_PLAUSIBLE_DENSITY * shapes.unit.mass)
        else {
            continue;
        };
        let gyration = (own.principal().0[0] / own.mass).sqrt();
        let is_far = gyration > MAX_GYRATION_RATIO * shapes.reach(&own.com)
            && gyration > MAX_GYRATION_RATIO * shapes.reach_of_all(link, &own.com, hulls);
        let far = || {
            let (gyration, reach) = (format_short(gyration), format_short(shapes.reach(&own.com)));
            format!(
                "its radius of gyration is {gyration} m, but its shapes reach only {reach} m from its center of mass"
            )
        };
        let why = match fault {
            Some(fault @ InertiaFault::NotPositiveDefinite { .. }) => fault.to_string(),
            Some(InertiaFault::Triangle { .. }) if is_far => far(),
            None if is_far && is_free => far(),
            _ if is_far => {
                let message = format!(
                    "link {:?}: {}; this inertia is implausible for the shapes, but was kept",
                    link.name,
                    far()
                );
                let (kind, source) = (DiagnosticKind::InertiaImplausible, inertial.source.clone());
                diagnostics.push(Diagnostic::new(kind, source, message));
                continue;
            }
            _ => continue,
        };
        let replaced = Inertial {
            source: inertial.source.clone(),
            link_from_com: inertial.link_from_com.translation.into(),
            ..shapes.inertial(link, inertial.mass)
        };
        let moments = |of: &RigidInertia| {
            let (moments, _) = of.principal();
            format!("({}) kg m²", [moments[0], moments[1], moments[2]].map(format_short).join(", "))
        };
        let message = format!(
            "link {:?}: {why}; its principal moments {} were replaced by {}, computed from its {} shapes and its mass \
             of {} kg",
            link.name,
            moments(&own),
            moments(&RigidInertia::from_inertial(&replaced)),
            shapes.kind,
            format_short(inertial.mass)
        );
        diagnostics.push(Diagnostic::new(DiagnosticKind::InertiaFromShapes, replaced.source.clone(), message));
        description.links[id.0].inertial = Some(replaced);
    }
}

/// Mass properties of a solid ball at the origin of a link. Its radius follows from `mass` \[kg\] and `density`
/// \[kg/m³\]; its source location is that of `link`.
pub fn solid_ball_inertial(link: &Link, mass: f64, density: f64) -> Inertial {
    let radius = (mass / density * 0.75 / PI).cbrt();
    let inertia = Matrix3::from_diagonal_element(0.4 * mass * radius * radius);
    Inertial { source: link.source.clone(), link_from_com: Pose::identity(), mass, inertia }
}

/// Solid formed by the shapes of a link.
struct ShapeSolid {
    /// Kind of the shapes: `collision` or `visual`.
    kind: &'static str,
    /// Mass properties for a density of 1 kg/m³, in the frame of the link.
    unit: RigidInertia,
    /// Corners of the bounding boxes of the shapes in the frame of the link \[m\].
    corners: Vec<Vector3<f64>>,
}

impl ShapeSolid {
    /// Collects the collision shapes, or the visual shapes of a link without collision shapes; `None` if they have no
    /// volume.
    fn of(link: &Link, hulls: &mut HullSet<'_>) -> Option<Self> {
        let kind = if link.collisions.is_empty() { "visual" } else { "collision" };
        let collisions = link.collisions.iter().map(|shape| (&shape.geometry, &shape.link_from_shape));
        let visuals = link.visuals.iter().map(|shape| (&shape.geometry, &shape.link_from_shape));
        let mut shapes = Self { kind, unit: RigidInertia::ZERO, corners: Vec::new() };
        for (geometry, pose) in collisions.chain(visuals.filter(|_| kind == "visual")) {
            let Some((inertia, bounds)) = solid_inertia(geometry, hulls) else { continue };
            shapes.unit = shapes.unit.combine(&inertia.transformed(pose));
            shapes.corners.extend(corners(bounds, pose));
        }
        let volume = shapes.unit.mass;
        let is_usable = volume > 0.0 && volume.is_finite() && shapes.unit.inertia.iter().all(|x| x.is_finite());
        is_usable.then_some(shapes)
    }

    /// Mass properties of the solid with the given mass and uniform density.
    fn inertial(&self, link: &Link, mass: f64) -> Inertial {
        let link_from_com = nalgebra::Translation3::from(self.unit.com).into();
        let inertia = self.unit.inertia * (mass / self.unit.mass);
        Inertial { source: link.source.clone(), link_from_com, mass, inertia }
    }

    /// Largest distance \[m\] from `com` to a corner of the bounding boxes of the collision and visual shapes of the
    /// link.
    fn reach_of_all(&self, link: &Link, com: &Vector3<f64>, hulls: &mut HullSet<'_>) -> f64 {
        let shapes = link.visuals.iter().map(|shape| (&shape.geometry, &shape.link_from_shape));
        shapes
            .filter_map(|(geometry, pose)| solid_inertia(geometry, hulls).map(|(_, bounds)| corners(bounds, pose)))
            .flatten()
            .map(|corner| (corner - com).norm())
            .fold(self.reach(com), f64::max)
    }

    /// Largest distance \[m\] from `com` to a corner in `corners`.
    fn reach(&self, com: &Vector3<f64>) -> f64 {
        self.corners.iter().map(|corner| (corner - com).norm()).fold(0.0, f64::max)
    }
}

/// Corners of a box at a pose, from its lowest and highest corner.
fn corners([low, high]: [Vector3<f64>; 2], pose: &Pose) -> [Vector3<f64>; 8] {
    std::array::from_fn(|corner| {
        let end = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        (pose * nalgebra::Point3::new(end(0), end(1), end(2))).coords
    })
}

/// Mass properties of a shape for a density of 1 kg/m³ and its bounding box, in its own frame. `None` for a mesh that
/// cannot be read or whose hull has no volume.
///
/// The closed forms are those of solids of uniform density in any textbook. A capsule is a cylinder and two half balls,
/// each with its center of mass 3r/8 from its plane.
fn solid_inertia(geometry: &Geometry, hulls: &mut HullSet<'_>) -> Option<(RigidInertia, [Vector3<f64>; 2])> {
    let body = |mass: f64, moments: [f64; 3], half: Vector3<f64>| {
        let inertia = Matrix3::from_diagonal(&Vector3::from(moments));
        (RigidInertia { mass, com: Vector3::zeros(), inertia }, [-half, half])
    };
    Some(match *geometry {
        Geometry::Box { size } => {
            let mass = size.product();
            let squares = size.component_mul(&size) * (mass / 12.0);
            body(mass, [squares.y + squares.z, squares.x + squares.z, squares.x + squares.y], size / 2.0)
        }
        Geometry::Sphere { radius } => {
            let mass = 4.0 / 3.0 * PI * radius.powi(3);
            body(mass, [0.4 * mass * radius * radius; 3], Vector3::repeat(radius))
        }
        Geometry::Cylinder { radius, length } => {
            let mass = PI * radius * radius * length;
            let across = mass * (3.0 * radius * radius + length * length) / 12.0;
            let along = mass * radius * radius / 2.0;
            body(mass, [across, across, along], Vector3::new(radius, radius, length / 2.0))
        }
        Geometry::Capsule { radius, length } => {
            let (tube, ends) = (PI * radius * radius * length, 4.0 / 3.0 * PI * radius.powi(3));
            let (rr, ll) = (radius * radius, length * length);
            let across = tube * (3.0 * rr + ll) / 12.0 + ends * (0.4 * rr + ll / 4.0 + 3.0 / 8.0 * length * radius);
            let along = tube * rr / 2.0 + ends * 0.4 * rr;
            body(tube + ends, [across, across, along], Vector3::new(radius, radius, length / 2.0 + radius))
        }
        Geometry::Mesh { .. } => {
            let hull = hulls.of_mesh(geometry)?;
            let VolumeIntegrals { volume, center, second_moment } = hull.volume_integrals()?;
            let (low, high) = hull.bounds()?;
            let inertia = Matrix3::identity() * second_moment.trace() - second_moment;
            let bounds = [low, high].map(|end| Vector3::from(end.map(f64::from)));
            (RigidInertia { mass: volume, com: center, inertia }, bounds)
        }
    })
}

/// Formats a number with up to four significant digits, for messages.
fn format_short(number: f64) -> String {
    if number == 0.0 {
        "0".to_owned()
    } else if (1e-3..1e4).contains(&number.abs()) {
        let decimals = (3 - number.abs().log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{number:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{number:.3e}")
    }
}
