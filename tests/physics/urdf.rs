//! URDF text from a few numbers: bodies, joints, chains.

use nalgebra::Matrix3;
use std::fmt::Write as _;

/// A link and its mass properties.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    /// Mass \[kg\].
    pub(crate) mass: f64,
    /// Center of mass in the link frame \[m\], and rotation of the axes of `inertia` (roll, pitch, yaw) \[rad\].
    pub(crate) com: [f64; 3],
    pub(crate) rpy: [f64; 3],
    /// Inertia about the center of mass \[kg m²\].
    pub(crate) inertia: Matrix3<f64>,
    /// Content of the collision's `<geometry>`; empty for no collisions.
    pub(crate) shape: String,
}

impl Link {
    /// A body with these moments about its origin and no collision shape.
    pub(crate) fn new(name: &str, mass: f64, moments: [f64; 3]) -> Self {
        let inertia = Matrix3::from_diagonal(&moments.into());
        Self { name: name.into(), mass, com: [0.0; 3], rpy: [0.0; 3], inertia, shape: String::new() }
    }

    /// A solid box of the edge lengths a, b and c: m (b² + c²)/12.
    pub(crate) fn brick(name: &str, mass: f64, [a, b, c]: [f64; 3]) -> Self {
        let moments = [b * b + c * c, a * a + c * c, a * a + b * b].map(|s| mass * s / 12.0);
        Self { shape: format!("<box size=\"{a} {b} {c}\"/>"), ..Self::new(name, mass, moments) }
    }

    /// A solid ball: 2/5 m r².
    pub(crate) fn ball(name: &str, mass: f64, radius: f64) -> Self {
        Self::sphere(name, mass, radius, 0.4 * mass * radius * radius)
    }

    /// A ball with this moment about its center: 2/3 m r² for a shell.
    pub(crate) fn sphere(name: &str, mass: f64, radius: f64, moment: f64) -> Self {
        Self { shape: format!("<sphere radius=\"{radius}\"/>"), ..Self::new(name, mass, [moment; 3]) }
    }

    /// A solid cylinder about z: m r²/2, and m (3 r² + l²)/12 across.
    pub(crate) fn cylinder(name: &str, mass: f64, radius: f64, length: f64) -> Self {
        let across = mass * (3.0 * radius * radius + length * length) / 12.0;
        let moments = [across, across, mass * radius * radius / 2.0];
        let shape = format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>");
        Self { shape, ..Self::new(name, mass, moments) }
    }

    /// A point mass at `com`, with negligible moments.
    pub(crate) fn point(name: &str, mass: f64, com: [f64; 3]) -> Self {
        Self { com, ..Self::new(name, mass, [POINT_MOMENT; 3]) }
    }

    pub(crate) fn at(self, com: [f64; 3]) -> Self {
        Self { com, ..self }
    }

    /// The same link without a collision shape.
    pub(crate) fn without_collision(self) -> Self {
        Self { shape: String::new(), ..self }
    }
}

/// The moment of a point mass \[kg m²\], because MuJoCo requires a positive one. Its effect is part of the laws that
/// use it.
pub(crate) const POINT_MOMENT: f64 = 1e-9;

/// A joint; by default at the parent's origin with the parent's axes.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) kind: &'static str,
    pub(crate) parent: String,
    pub(crate) child: String,
    pub(crate) xyz: [f64; 3],
    pub(crate) rpy: [f64; 3],
    pub(crate) axis: [f64; 3],
    /// Attributes of `<limit>`.
    pub(crate) limit: String,
    /// Further elements, such as `<dynamics damping="1"/>`.
    pub(crate) extra_elements: String,
}

impl Joint {
    fn new(kind: &'static str, name: &str, [parent, child]: [&str; 2], axis: [f64; 3]) -> Self {
        let [name, parent, child] = [name, parent, child].map(str::to_string);
        let (limit, extra_elements) = (String::new(), String::new());
        Self { name, kind, parent, child, xyz: [0.0; 3], rpy: [0.0; 3], axis, limit, extra_elements }
    }

    /// A hinge without limits.
    pub(crate) fn hinge(name: &str, parent_and_child: [&str; 2], axis: [f64; 3]) -> Self {
        Self::new("continuous", name, parent_and_child, axis)
    }

    /// A slide with distant limits.
    pub(crate) fn slide(name: &str, parent_and_child: [&str; 2], axis: [f64; 3]) -> Self {
        Self::new("prismatic", name, parent_and_child, axis).limit(-1e3, 1e3, 1e9)
    }

    pub(crate) fn fixed(name: &str, parent_and_child: [&str; 2]) -> Self {
        Self::new("fixed", name, parent_and_child, [1.0, 0.0, 0.0])
    }

    pub(crate) fn at(self, xyz: [f64; 3]) -> Self {
        Self { xyz, ..self }
    }

    pub(crate) fn turned(self, rpy: [f64; 3]) -> Self {
        Self { rpy, ..self }
    }

    /// Range \[rad or m\] and largest effort \[N m or N\]. A hinge with limits is a revolute joint.
    pub(crate) fn limit(self, lower: f64, upper: f64, effort: f64) -> Self {
        let kind = if self.kind == "continuous" { "revolute" } else { self.kind };
        let limit = format!("lower=\"{lower}\" upper=\"{upper}\" effort=\"{effort}\" velocity=\"1e3\"");
        Self { kind, limit, ..self }
    }

    /// Viscous damping \[N m s/rad or N s/m\] and dry friction \[N m or N\].
    pub(crate) fn dynamics(self, damping: f64, friction: f64) -> Self {
        Self {
            extra_elements: format!("{}<dynamics damping=\"{damping}\" friction=\"{friction}\"/>", self.extra_elements),
            ..self
        }
    }

    pub(crate) fn mimic(self, joint: &str, multiplier: f64) -> Self {
        Self {
            extra_elements: format!("{}<mimic joint=\"{joint}\" multiplier=\"{multiplier}\"/>", self.extra_elements),
            ..self
        }
    }
}

/// A massless link, the base of a chain.
pub(crate) fn base() -> Link {
    Link::new("base", 0.0, [0.0; 3])
}

/// The URDF text; massless links have no `<inertial>`.
pub(crate) fn urdf(links: &[Link], joints: &[Joint]) -> String {
    let v = |x: [f64; 3]| format!("{} {} {}", x[0], x[1], x[2]);
    let mut out = String::from("<robot name=\"law\">\n");
    for link in links {
        let _ = write!(out, "<link name=\"{}\">", link.name);
        if link.mass > 0.0 {
            let i = &link.inertia;
            let _ = write!(
                out,
                "<inertial><origin xyz=\"{}\" rpy=\"{}\"/><mass value=\"{}\"/><inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" \
                 iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
                v(link.com),
                v(link.rpy),
                link.mass,
                i[(0, 0)],
                i[(0, 1)],
                i[(0, 2)],
                i[(1, 1)],
                i[(1, 2)],
                i[(2, 2)]
            );
        }
        if !link.shape.is_empty() {
            let _ = write!(
                out,
                "<collision><origin xyz=\"{}\"/><geometry>{}</geometry></collision>",
                v(link.com),
                link.shape
            );
        }
        out.push_str("</link>\n");
    }
    for joint in joints {
        let _ = write!(
            out,
            "<joint name=\"{}\" type=\"{}\"><parent link=\"{}\"/><child link=\"{}\"/><origin xyz=\"{}\" rpy=\"{}\"/>\
             <axis xyz=\"{}\"/>",
            joint.name,
            joint.kind,
            joint.parent,
            joint.child,
            v(joint.xyz),
            v(joint.rpy),
            v(joint.axis)
        );
        if !joint.limit.is_empty() {
            let _ = write!(out, "<limit {}/>", joint.limit);
        }
        let _ = writeln!(out, "{}</joint>", joint.extra_elements);
    }
    out + "</robot>\n"
}
