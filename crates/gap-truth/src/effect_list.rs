//! Lists of effects in which each stands once, with its id.

/// Declares an enum of effects, the lists of those in the contract's catalogue and of those outside it, and their ids.
macro_rules! effects {
    (
        $(#[$attribute:meta])*
        enum $name:ident;
        $(#[$about_inside:meta])*
        $catalogue:ident: [$($(#[$inside_doc:meta])* $inside:ident = $inside_id:literal,)+]
        $(#[$about_outside:meta])*
        $outside_list:ident: [$($(#[$outside_doc:meta])* $outside:ident = $outside_id:literal,)+]
    ) => {
        $(#[$attribute])*
        pub enum $name {
            $($(#[$inside_doc])* $inside,)+
            $($(#[$outside_doc])* $outside,)+
        }

        $(#[$about_inside])*
        pub const $catalogue: [$name; [$($inside_id),+].len()] = [$($name::$inside),+];

        $(#[$about_outside])*
        pub const $outside_list: [$name; [$($outside_id),+].len()] = [$($name::$outside),+];

        impl $name {
            /// The contract's id, or a name for tables.
            pub fn id(self) -> &'static str {
                match self {
                    $(Self::$inside => $inside_id,)+
                    $(Self::$outside => $outside_id,)+
                }
            }
        }
    };
}

pub(crate) use effects;
