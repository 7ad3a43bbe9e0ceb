# The NetCDF files of crates/import/tests/data: pip install netCDF4==1.7.5.1;
# python3 netcdf_trajectory.py trajectory.nc NETCDF3_CLASSIC; python3 netcdf_trajectory.py trajectory-5.nc NETCDF3_64BIT_DATA
# A CF trajectory in classic NetCDF by the netCDF4 package: time, place, CH4 in 1e-9, wind, packed temperature.
import netCDF4, numpy as np, sys
d = netCDF4.Dataset(sys.argv[1], 'w', format=sys.argv[2])
d.createDimension('obs', None)
n = 20
def var(name, kind, values, **more):
    v = d.createVariable(name, kind, ('obs',), fill_value=more.pop('fill', None))
    for k, a in more.items(): setattr(v, k, a)
    v.set_auto_maskandscale(False); v[:n] = values
t = np.arange(n)
var('t', 'f8', t * .5, standard_name='time', units='minutes since 2024-05-01 10:00:00')
var('lat', 'f8', 43.44 + 1e-4 * t, standard_name='latitude', units='degrees_north')
var('lon', 'f8', np.full(n, -7.86), standard_name='longitude', units='degrees_east')
var('z', 'f4', 700 + t, standard_name='altitude', units='m')
var('ch4', 'f4', np.where(t == 3, -999, 1900 + t), standard_name='mole_fraction_of_methane_in_air', units='1e-9', fill=np.float32(-999))
var('ta', 'i2', 1000 + 10 * t, standard_name='air_temperature', units='K', scale_factor=.01, add_offset=273.15)
s = d.createVariable('p', 'f4', ()); s.standard_name = 'air_pressure'; s.units = 'Pa'; s[...] = 93025
d.close()
