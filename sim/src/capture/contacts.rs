//! Contacts of MuJoCo as pairs of bodies, with forces in world axes.

use kinetoscope_mujoco::Data;
use kinetoscope_scene::Contact;
use nalgebra::{Matrix3, Vector3};

/// A contact with solved forces, between geoms.
#[derive(Clone, Debug)]
pub(crate) struct SolvedContact {
    /// Indices of the geoms in the model; negative for a part of a flex.
    pub(crate) geoms: [i32; 2],
    /// Distance of the geoms \[m\]; negative for penetration.
    pub(crate) distance: f64,
    /// Point in the environment \[m\].
    pub(crate) point: [f64; 3],
    /// Rows: the normal, from the first geom to the second, and two tangents.
    pub(crate) frame: [f64; 9],
    /// Force on the second geom in the axes of `frame` \[N\].
    pub(crate) force: [f64; 3],
}

impl SolvedContact {
    /// The contact between the owners of the geoms. `owners` has the body-axis index of each geom, `None` for the world.
    fn between(&self, owners: &[Option<u32>]) -> Option<Contact> {
        let owner = |geom: i32| usize::try_from(geom).ok().and_then(|geom| owners.get(geom)).copied();
        let [first, second] = self.geoms.map(owner);
        let world_from_contact = Matrix3::from_row_slice(&self.frame).transpose();
        Some(Contact {
            bodies: [first?, second?],
            point: self.point,
            normal: [self.frame[0], self.frame[1], self.frame[2]],
            distance: self.distance,
            force: (world_from_contact * Vector3::from(self.force)).into(),
            normal_force: self.force[0],
        })
    }
}

/// Replaces `contacts` by all contacts with constraint rows, whose forces are solved. `owners` has the body-axis index
/// of each geom, `None` for the world. Contacts within the margin only have no constraint rows and are left out.
pub(super) fn capture(owners: &[Option<u32>], data: &Data, contacts: &mut Vec<Contact>) {
    contacts.clear();
    for (index, contact) in data.contact().iter().enumerate().filter(|(_, contact)| contact.efc_address >= 0) {
        let [normal_force, tangent1, tangent2, ..] = data.contact_force(index);
        let solved = SolvedContact {
            geoms: [contact.geom1, contact.geom2],
            distance: contact.dist,
            point: contact.pos,
            frame: contact.frame,
            force: [normal_force, tangent1, tangent2],
        };
        contacts.extend(solved.between(owners));
    }
}

/// Replaces `contacts` by `solved`, as [`capture`] does.
pub(super) fn of_solved(
    owners: &[Option<u32>],
    solved: impl Iterator<Item = SolvedContact>,
    contacts: &mut Vec<Contact>,
) {
    contacts.clear();
    contacts.extend(solved.filter_map(|contact| contact.between(owners)));
}
