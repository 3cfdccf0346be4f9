"""A new cell file from answers and from what a controller's archive states.

``krl_data`` reads KRL data lists, ``archive`` finds them in a folder or zip, ``controller`` says what they
mean, ``questions`` lists what a person is asked, ``answers`` checks it, and ``cell_text`` writes the file.
"""
